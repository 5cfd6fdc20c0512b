import numpy as np

from rover_obstacle_detection.offline.ply import write_ply


def test_points_are_written_with_flag_confidence_and_colour(tmp_path):
    obstacles = np.array([[1, 2, 3, 0.2, 0.9], [4, 5, 6, 0.3, 0.7]], np.float32)
    ground = np.array([[7, 8, 9, 0.0]], np.float32)
    write_ply(tmp_path / 'points.ply', obstacles, ground)
    header, data = (tmp_path / 'points.ply').read_bytes().split(b'end_header\n')
    lines = header.decode().splitlines()
    assert lines[:2] == ['ply', 'format binary_little_endian 1.0']
    assert 'element vertex 3' in lines
    types = {'float': '<f4', 'uchar': 'u1'}
    fields = [line.split()[1:] for line in lines if line.startswith('property')]
    vertices = np.frombuffer(data, [(name, types[kind]) for kind, name in fields])
    points = np.column_stack([vertices[name] for name in ('x', 'y', 'z', 'height')])
    assert np.array_equal(points, np.vstack((obstacles[:, :4], ground)))
    assert vertices['confidence'].tolist() == np.float32([0.9, 0.7, 0]).tolist()
    assert vertices['obstacle'].tolist() == [1, 1, 0]
    assert vertices['red'][0] > vertices['green'][0]


def test_a_file_without_points_is_valid(tmp_path):
    obstacles, ground = np.zeros((0, 5), np.float32), np.zeros((0, 4), np.float32)
    write_ply(tmp_path / 'points.ply', obstacles, ground)
    content = (tmp_path / 'points.ply').read_bytes()
    assert b'element vertex 0' in content
    assert content.endswith(b'end_header\n')
