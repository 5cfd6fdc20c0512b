from __future__ import annotations

import pickle

import pytest

from rover_obstacle_detection.errors import BagError, failure_text


@pytest.mark.parametrize(
    ('name', 'shown'),
    [
        ('/camera\x0bleft', r'/camera\x0bleft'),
        ('a\n  b\r\x1b[31m', r'a b\r\x1b[31m'),
        ('\x85\u2028\u2029\x7f', r'\x85\u2028\u2029\x7f'),
        ('/caméra  左', '/caméra  左'),
    ],
)
def test_a_message_is_one_line_whatever_a_name_holds(name, shown):
    error = BagError(f'no calibration for {name}')
    assert str(error) == f'no calibration for {shown}'
    assert len(str(error).splitlines()) == 1
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    assert failure_text(error).isprintable()
