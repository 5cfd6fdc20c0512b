from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recordings import COMPRESSED, IMAGE, INFO, TEXT

from rover_obstacle_detection.bags.topics import (
    StereoTopics,
    find_stereo_topics,
    stereo_cameras,
)
from rover_obstacle_detection.errors import BagError


def topics(*names):
    """Map each topic to the message type that its name implies."""
    types = {'compressed': COMPRESSED, 'log': TEXT}
    return {
        name: INFO if name.endswith('info') else types.get(name.rpartition('/')[2], IMAGE)
        for name in names
    }


def both(*names):
    """Return the left and right topic for each name; `{}` stands for the side."""
    return topics(*(name.format(side) for name in names for side in ('left', 'right')))


@pytest.mark.parametrize(
    ('name', 'info'),
    [
        ('/{}/image_rect', '/{}/camera_info'),
        ('/stereo/{}/image_rect', '/stereo/{}/camera_info'),
        ('/a/b/c/{}/image_rect_color', '/a/b/c/{}/camera_info'),
        ('/camera/{}/image_raw', '/camera/{}/camera_info'),
        ('/camera/{}/image_raw/compressed', '/camera/{}/camera_info'),
        ('{}/image_rect', '{}/camera_info'),
        ('/navcam_{}/image_rect', '/navcam_{}/camera_info'),
        ('/{}_camera/image', '/{}_camera/camera_info'),
        ('/navcam_{}', '/navcam_{}/camera_info'),
        ('/{}_image', '/{}_camera_info'),
        ('/obstacle_detection/{}/image_rect', '/obstacle_detection/{}/camera_info'),
        ('/front{}/image_raw', '/front{}/camera_info'),
        ('/front_{}/image_raw', '/front_{}/camera_info'),
        ('/rear{}/image', '/rear{}/camera_info'),
        ('/{}_image_rect', '/{}_info'),
        ('/stereo/{}_image', '/stereo/{}_info'),
        ('/stereo/{}_image', '/stereo/{}/camera_info'),
        ('/zed/{}_raw', '/zed/{}_info'),
        ('/zed/zed_node/{}_raw/image_raw_color', '/zed/zed_node/{}_raw/camera_info'),
    ],
)
def test_topics_are_found_by_name_in_any_namespace(name, info):
    kinds = {
        **both(name),
        **{info.format(side): INFO for side in ('left', 'right')},
        '/log': TEXT,
    }
    assert find_stereo_topics(kinds) == StereoTopics(
        *(each.format(side) for each in (name, info) for side in ('left', 'right'))
    )


@pytest.mark.parametrize(
    ('name', 'info'),
    [
        ('/cam{}/image_raw', '/cam{}/camera_info'),
        ('/camera{}', '/camera{}/camera_info'),
        ('/rover/camera_{}/image_rect', '/rover/camera_{}/camera_info'),
        ('/navcam{}/image_raw/compressed', '/navcam{}/camera_info'),
    ],
)
def test_numbered_cameras_are_a_pair(name, info):
    names = [each.format(number) for each in (name, info) for number in (0, 1)]
    assert find_stereo_topics(topics(*names)) == StereoTopics(*names)
    assert stereo_cameras(topics(*names)) == [StereoTopics(*names)]


@pytest.mark.parametrize(
    'names',
    [
        ('/cam0/image_raw',),
        ('/cam0/image_raw', '/cam2/image_raw'),
        ('/cam1/image_raw', '/cam2/image_raw'),
        ('/image0', '/image1'),
        ('/scamp0/image', '/scamp1/image'),
        ('/cam0/depth/image', '/cam1/depth/image'),
        ('/mask/cam0/image', '/mask/cam1/image'),
        ('/segmentation_cam0', '/segmentation_cam1'),
        ('/camera0/left/image', '/camera1/left/image'),
    ],
)
def test_other_numbers_name_no_pair(names):
    with pytest.raises(BagError, match=r'no stereo topics|only left images'):
        find_stereo_topics(topics(*names))
    assert stereo_cameras(topics(*names)) == []


def test_words_win_over_numbers():
    kinds = {**both('/s/{}/image_rect'), **topics('/cam0/image_raw', '/cam1/image_raw')}
    assert find_stereo_topics(kinds).left_image == '/s/left/image_rect'
    found = find_stereo_topics(kinds, left_image='/cam0/image_raw')
    assert found.right_image == '/cam1/image_raw'
    several = both('/camera0/{}/image', '/camera1/{}/image')
    assert [each.right_image for each in stereo_cameras(several)] == [
        '/camera0/right/image',
        '/camera1/right/image',
    ]


def test_front_and_rear_are_two_cameras():
    with pytest.raises(BagError, match='2 stereo cameras: /frontleft/image and /frontright/image'):
        find_stereo_topics(both('/front{}/image', '/rear{}/image'))


def test_an_infrared_pair_is_found():
    kinds = topics(
        '/camera/infra1/image_rect_raw',
        '/camera/infra2/image_rect_raw',
        '/camera/infra1/camera_info',
        '/camera/infra2/camera_info',
        '/camera/depth/image_rect_raw',
        '/camera/color/image_raw',
    )
    found = find_stereo_topics(kinds)
    assert found.left_image == '/camera/infra1/image_rect_raw'
    assert found.right_image == '/camera/infra2/image_rect_raw'
    assert found.right_info == '/camera/infra2/camera_info'
    assert found.is_rectified


PREFERENCE = [
    '/s/{}/image_rect',
    '/s/{}/image_rect/compressed',
    '/s/{}/image_rect_gray',
    '/s/{}/image_rect_color',
    '/s/{}/image_rect_color/compressed',
    '/s/{}/image_raw',
    '/s/{}/image_raw/compressed',
    '/s/{}/image',
]


@given(st.sets(st.sampled_from(PREFERENCE), min_size=1), st.randoms())
def test_rectified_grey_uncompressed_images_are_preferred(names, random):
    kinds = list(both(*names).items())
    random.shuffle(kinds)
    best = min(names, key=PREFERENCE.index)
    found = find_stereo_topics(dict(kinds))
    assert (found.left_image, found.right_image) == (best.format('left'), best.format('right'))
    assert found.is_rectified == ('rect' in best)


@pytest.mark.parametrize(
    ('rectified', 'raw'),
    [
        ('/zed/{}/image_rect_color', '/zed/{}_raw/image_raw_color'),
        ('/zed/{}/color/rect/image', '/zed/{}/color/raw/image'),
    ],
)
def test_raw_and_rectified_topics_belong_to_one_camera(rectified, raw):
    found = find_stereo_topics(both(rectified, raw))
    assert found.left_image == rectified.format('left')
    assert found.is_rectified
    assert not find_stereo_topics(both(raw)).is_rectified


@pytest.mark.parametrize(
    'other',
    ['{}/depth', '{}/disparity', 'depth_{}/image', '{}/image_rect/compressedDepth'],
)
def test_derived_images_are_not_camera_images(other):
    assert find_stereo_topics(both('/s/{}/image', f'/s/{other}')).left_image == '/s/left/image'
    with pytest.raises(BagError, match='no stereo topics'):
        find_stereo_topics(both(f'/s/{other}'))


def test_left_and_right_within_a_word_do_not_count():
    with pytest.raises(BagError, match='no stereo topics'):
        find_stereo_topics(topics('/leftover/image_raw', '/rightover/image_raw'))


def test_left_in_the_namespace_does_not_name_the_camera():
    kinds = both('/left_arm/camera/{}/image_rect')
    found = find_stereo_topics(kinds)
    assert found.right_image == '/left_arm/camera/right/image_rect'


def test_several_cameras_are_listed_and_one_can_be_chosen():
    kinds = both('/front/{}/image_rect', '/front/{}/camera_info', '/rear/{}/image_raw')
    with pytest.raises(BagError) as caught:
        find_stereo_topics(kinds)
    assert str(caught.value) == (
        '2 stereo cameras: /front/left/image_rect and /front/right/image_rect; '
        '/rear/left/image_raw and /rear/right/image_raw: '
        'choose one with --left-topic and --right-topic'
    )
    assert find_stereo_topics(kinds, left_image='/front/left/image_rect') == StereoTopics(
        '/front/left/image_rect',
        '/front/right/image_rect',
        '/front/left/camera_info',
        '/front/right/camera_info',
    )
    rear = find_stereo_topics(kinds, right_image='/rear/right/image_raw')
    assert rear == StereoTopics('/rear/left/image_raw', '/rear/right/image_raw')


def test_given_topics_may_have_any_name():
    kinds = topics('/cam0/image', '/cam1/image', '/cam0/camera_info', '/cam1/camera_info')
    found = find_stereo_topics(kinds, left_image='/cam0/image', right_image='/cam1/image')
    assert (found.left_info, found.right_info) == ('/cam0/camera_info', '/cam1/camera_info')
    assert found.namespace == ''


def test_a_shared_camera_info_is_not_used():
    kinds = topics('/left', '/right', '/camera_info')
    assert find_stereo_topics(kinds) == StereoTopics('/left', '/right')


@pytest.mark.parametrize(
    ('image', 'namespace'),
    [
        ('/stereo/left/image_rect', '/stereo'),
        ('/a/b/left/image_rect/compressed', '/a/b'),
        ('/left/image_rect', ''),
        ('left/image_rect', ''),
        ('/rover/navcam_left/image', '/rover'),
        ('/rover/cam0/image', '/rover'),
    ],
)
def test_the_namespace_is_the_common_prefix(image, namespace):
    right = image.replace('left', 'right').replace('cam0', 'cam1')
    assert StereoTopics(image, right).namespace == namespace


@pytest.mark.parametrize(
    ('kinds', 'given', 'words'),
    [
        (
            topics('/log'),
            {},
            'no stereo topics: the recording has /log (std_msgs/msg/String)',
        ),
        ({}, {}, 'no stereo topics: the recording has no topics'),
        (
            topics('/s/left/image_rect', '/log'),
            {},
            'only left images: /s/left/image_rect: expected a right topic',
        ),
        (
            topics('/s/right/image_rect'),
            {},
            'only right images: /s/right/image_rect: expected a left topic',
        ),
        (
            topics('/s/left/image_rect', '/s/right/image_raw'),
            {},
            'only left images: /s/left/image_rect',
        ),
        (
            topics('/s/left/image', '/log'),
            {'left_image': '/none'},
            'no topic /none: the recording has /s/left/image (sensor_msgs/msg/Image)',
        ),
        (topics('/log'), {'left_image': '/log'}, 'topic /log is std_msgs/msg/String: expected'),
        (
            topics('/cam0/image', '/cam2/image'),
            {'left_image': '/cam0/image'},
            'no right image topic matches /cam0/image: give --right-topic; the recording has',
        ),
        (
            both('/s/{}/image'),
            {'left_image': '/s/left/image', 'right_image': '/s/left/image'},
            'left and right image topic are both /s/left/image: expected two topics',
        ),
    ],
)
def test_errors_list_the_topics_of_the_recording(kinds, given, words):
    with pytest.raises(BagError) as caught:
        find_stereo_topics(kinds, **given)
    assert str(caught.value).startswith(words)


def test_a_long_topic_list_is_shortened():
    with pytest.raises(BagError, match=r'/t00 .*/t11 .* and 28 more: expected'):
        find_stereo_topics({f'/t{number:02}': TEXT for number in range(40)})
