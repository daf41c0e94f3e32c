"""Contacts from CSV files: what is read, and what is said of what can't be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from palpate.recognizer import ANYTHING, EDGE, FACE, read_contacts


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "felt.csv"
    path.write_bytes(text.encode())
    return path


def test_positions_normals_and_bounds_are_read_in_any_order_of_columns(tmp_path):
    path = written(
        tmp_path,
        "nz,ny,nx,x,y,z,position_error,normal_error,kind\n"
        "1,0,0,1,2,3,0.5,0.2,face\n"
        "\n"
        ",,,4,5,6,,,\n"
        "0,0,-1,7,8,9,,,edge\n",
    )
    felt = read_contacts(path, position_error=0.004, normal_error=0.3, scale=1e-3)
    contacts = felt.contacts
    assert contacts.positions == pytest.approx(np.arange(1, 10).reshape(3, 3) * 1e-3)
    assert contacts.normals[[0, 2]].tolist() == [[0, 0, 1], [-1, 0, 0]]
    assert contacts.position_error == pytest.approx([0.0005, 0.004, 0.004])
    assert contacts.normal_error == pytest.approx([0.2, np.pi, 0.3])
    assert contacts.kinds.tolist() == [FACE, ANYTHING, EDGE]
    assert felt.rows == (2, 4, 5)
    assert len(felt.free_space) == felt.misses == 0


def test_windows_line_ends_semicolons_decimal_commas_and_a_byte_order_mark_are_accepted(tmp_path):
    usual = written(tmp_path, "x,y,z\n1.5,2,3\n4,5,6\n")
    plain = read_contacts(usual, position_error=1.0).contacts
    for text in (
        "x,y,z\r\n1.5,2,3\r\n4,5,6\r\n",
        "x;y;z\r\n1,5;2;3\r\n4;5;6\r\n",
        "X\tY\tZ\n1.5\t2\t3\n4\t5\t6",
        "\ufeffx, y, z\n1.5, 2, 3\n4, 5, 6\n",
        "x,y,z,,\n1.5,2,3,,\n4,5,6,,\n",
    ):
        path = written(tmp_path, text)
        assert np.array_equal(
            read_contacts(path, position_error=1.0).contacts.positions, plain.positions
        )


def test_ways_that_were_free_are_read_to_contacts_and_to_nothing(tmp_path):
    path = written(
        tmp_path,
        "x,y,z,sx,sy,sz,ex,ey,ez\n0,0,0,0,0,100,,,\n5,0,0,,,,,,\n,,,9,0,50,9,0,-50\n",
    )
    felt = read_contacts(path, position_error=0.1)
    assert len(felt.contacts) == 2
    assert felt.misses == 1
    assert felt.free_space.starts.tolist() == [[0, 0, 100], [9, 0, 50]]
    assert felt.free_space.ends.tolist() == [[0, 0, 0], [9, 0, -50]]
    assert felt.free_space.error == pytest.approx([0.1, 0.1])
    assert felt.contacts.approaches.tolist() == [[0, 0, -1], [0, 0, 0]]


def test_the_direction_of_a_short_way_is_not_relied_on(tmp_path):
    path = written(tmp_path, "x,y,z,sx,sy,sz\n0,0,0,0,0,5\n0,0,0,0,0,0\n")
    felt = read_contacts(path, position_error=0.1)
    assert not felt.contacts.approach_known.any()
    assert len(felt.free_space) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("x,y,z\n", "no rows under the header"),
        ("1,2,3\n4,5,6\n", "the first line must name the columns"),
        ("x,y\n1,2\n", "a column x but none for z"),
        ("a,b,c\n1,2,3\n", "no columns x, y, z"),
        ("x,y,z,w\n1,2,3,4\n", "what is the column 'w'"),
        ("x,y,z,x\n1,2,3,4\n", "the column x is there twice"),
        ("x,y,z,nx\n1,2,3,1\n", "a column nx but none for ny, nz"),
        ("x,y,z\n1,2,3\n1,two,3\n", "line 3: y is 'two', which is no number"),
        ("x,y,z\n1,inf,3\n", "line 2: y is 'inf'; it must be finite"),
        ("x,y,z\n1,,3\n", "line 2: x, z but no y"),
        ("x,y,z\n1,2,3,4\n", "line 2: 4 values under 3 columns"),
        ("x,y,z,nx,ny,nz\n1,2,3,1,1,0\n", r"line 2: nx,ny,nz has length 1\.414"),
        ("x,y,z,position_error\n1,2,3,-1\n", "line 2: position_error is -1"),
        ("x,y,z,nx,ny,nz,normal_error\n1,2,3,1,0,0,4\n", "line 2: normal_error is 4 rad"),
        ("x,y,z,kind\n1,2,3,corner\n", "line 2: kind is 'corner'"),
        ("x,y,z,sx,sy,sz\n,,,1,2,3\n", "line 2: neither a contact"),
        ("x,y,z,ex,ey,ez\n1,2,3,1,2,3\n", "line 2: a contact .* and an end"),
    ],
)
def test_a_file_that_cannot_be_read_is_told_with_its_row(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(ValueError, match=words) as told:
        read_contacts(path, position_error=1.0, normal_error=0.1)
    assert str(path) in str(told.value)


def test_a_missing_file_and_a_picture_are_told(tmp_path):
    with pytest.raises(ValueError, match="No such file"):
        read_contacts(tmp_path / "none.csv")
    (tmp_path / "felt.csv").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(ValueError, match="not a text file"):
        read_contacts(tmp_path / "felt.csv")


def test_a_bound_has_to_come_from_somewhere(tmp_path):
    path = written(tmp_path, "x,y,z,nx,ny,nz\n1,2,3,1,0,0\n")
    with pytest.raises(ValueError, match="line 2: no position_error"):
        read_contacts(path, normal_error=0.1)
    with pytest.raises(ValueError, match="line 2: no normal_error"):
        read_contacts(path, position_error=0.1)
