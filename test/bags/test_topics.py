from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recordings import COMPRESSED, IMAGE, INFO, TEXT

from rover_obstacle_detection.bags.topics import StereoTopics, find_stereo_topics
from rover_obstacle_detection.errors import BagError


def topics(*names):
    """Give each topic the type that its name tells of."""
    types = {'compressed': COMPRESSED, 'camera_info': INFO, 'log': TEXT}
    return {name: types.get(name.rpartition('/')[2], IMAGE) for name in names}


def both(*names):
    """Name the topics of both eyes, `{}` standing for the eye."""
    return topics(*(name.format(eye) for name in names for eye in ('left', 'right')))


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
        ('/zed/zed_node/{}_raw/image_raw_color', '/zed/zed_node/{}_raw/camera_info'),
    ],
)
def test_topics_are_found_by_name_in_any_namespace(name, info):
    kinds = {
        **both(name),
        **{info.format(eye): INFO for eye in ('left', 'right')},
        '/log': TEXT,
    }
    assert find_stereo_topics(kinds) == StereoTopics(
        *(each.format(eye) for each in (name, info) for eye in ('left', 'right'))
    )


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
def test_rectified_is_preferred_over_raw_grey_over_colour_plain_over_compressed(names, random):
    kinds = list(both(*names).items())
    random.shuffle(kinds)
    best = min(names, key=PREFERENCE.index)
    found = find_stereo_topics(dict(kinds))
    assert (found.left_image, found.right_image) == (best.format('left'), best.format('right'))
    assert found.is_rectified == ('rect' in best)


def test_a_raw_topic_beside_a_rectified_one_is_the_same_camera():
    kinds = both('/zed/{}/image_rect_color', '/zed/{}_raw/image_raw_color')
    assert find_stereo_topics(kinds).left_image == '/zed/left/image_rect_color'


@pytest.mark.parametrize(
    'other',
    ['{}/depth', '{}/disparity', 'depth_{}/image', '{}/image_rect/compressedDepth'],
)
def test_other_pictures_are_not_camera_images(other):
    assert find_stereo_topics(both('/s/{}/image', f'/s/{other}')).left_image == '/s/left/image'
    with pytest.raises(BagError, match='no stereo topics'):
        find_stereo_topics(both(f'/s/{other}'))


def test_an_eye_that_is_part_of_a_word_is_none():
    with pytest.raises(BagError, match='no stereo topics'):
        find_stereo_topics(topics('/leftover/image_raw', '/rightover/image_raw'))


def test_arms_that_are_left_and_right_do_not_confuse_the_eyes():
    kinds = both('/left_arm/camera/{}/image_rect')
    found = find_stereo_topics(kinds)
    assert found.right_image == '/left_arm/camera/right/image_rect'


def test_several_cameras_are_listed_and_can_be_chosen_from():
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


def test_topics_of_any_names_can_be_given():
    kinds = topics('/cam0/image', '/cam1/image', '/cam0/camera_info', '/cam1/camera_info')
    found = find_stereo_topics(kinds, left_image='/cam0/image', right_image='/cam1/image')
    assert (found.left_info, found.right_info) == ('/cam0/camera_info', '/cam1/camera_info')
    assert found.namespace == ''
    swapped = find_stereo_topics(
        kinds,
        left_image='/cam0/image',
        right_image='/cam1/image',
        left_info='/cam1/camera_info',
        right_info='/cam0/camera_info',
    )
    assert (swapped.left_info, swapped.right_info) == ('/cam1/camera_info', '/cam0/camera_info')


def test_a_camera_info_that_both_eyes_would_share_is_none():
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
def test_the_namespace_is_what_comes_before_the_eye(image, namespace):
    right = image.replace('left', 'right').replace('cam0', 'cam1')
    assert StereoTopics(image, right).namespace == namespace


@pytest.mark.parametrize(
    ('kinds', 'given', 'words'),
    [
        (topics('/log'), {}, 'no stereo topics: it holds /log (std_msgs/msg/String): expected'),
        ({}, {}, 'no stereo topics: it holds no topics'),
        (
            topics('/s/left/image_rect', '/log'),
            {},
            'only images of the left eye: /s/left/image_rect: expected a right one',
        ),
        (
            topics('/s/right/image_rect'),
            {},
            'only images of the right eye: /s/right/image_rect: expected a left one',
        ),
        (
            topics('/s/left/image_rect', '/s/right/image_raw'),
            {},
            'only images of the left eye: /s/left/image_rect',
        ),
        (
            topics('/s/left/image', '/log'),
            {'left_image': '/none'},
            'no topic /none: it holds /s/left/image (sensor_msgs/msg/Image)',
        ),
        (topics('/log'), {'left_image': '/log'}, 'topic /log is std_msgs/msg/String: expected'),
        (
            both('/s/{}/image'),
            {'left_info': '/s/left/image'},
            'topic /s/left/image is sensor_msgs/msg/Image: expected sensor_msgs/msg/CameraInfo',
        ),
        (
            topics('/cam0/image', '/cam1/image'),
            {'left_image': '/cam0/image'},
            'no right partner of /cam0/image: choose it with --right-topic; it holds',
        ),
        (
            both('/s/{}/image'),
            {'left_image': '/s/left/image', 'right_image': '/s/left/image'},
            'left and right are both /s/left/image: expected two topics',
        ),
    ],
)
def test_what_is_missing_is_said_with_what_there_is(kinds, given, words):
    with pytest.raises(BagError) as caught:
        find_stereo_topics(kinds, **given)
    assert str(caught.value).startswith(words)


def test_a_long_list_is_cut():
    with pytest.raises(BagError, match=r'/t00 .*/t11 .* and 28 more: expected'):
        find_stereo_topics({f'/t{number:02}': TEXT for number in range(40)})
