"""Files of numbers are read to the last line, or refused in one sentence with the file and the line."""

import csv

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym.envs.paths import load_path
from seastar_gym.files import read_numbers, read_rows

GOOD = b"0.0,0.0\n0.1,0.6\n1.0,0.0\n"
NUMBERS = [[0.0, 0.0], [0.1, 0.6], [1.0, 0.0]]


def read(tmp_path, data):
    file = tmp_path / "numbers.csv"
    file.write_bytes(data)
    return read_numbers(file, "a time and an angle", 2)


@pytest.mark.parametrize(
    "data",
    [
        GOOD,
        b"\xef\xbb\xbf" + GOOD,
        b"\xef\xbb\xbftime [s],angle [rad]\n" + GOOD,
        "Zeit [s],Winkel [°]\n".encode() + GOOD,
        GOOD.replace(b"\n", b"\r\n"),
        GOOD.replace(b"\n", b"\r"),
        GOOD.replace(b"\n", b"\n\n \n"),
        GOOD.replace(b",", b" , ").rstrip(),
        b'"0","0"\n+.1,6e-1\n1.,-0\n',
        b"\xef\xbb\xbftime [s];angle [rad]\n0,0;0\n0,1;0,6\n1,0;0,0\n",
        b"time [s]\tangle [rad]\n0,0\t0\n0.1\t0.6\n1\t0\n",
        b"0,0;0,0\n0,1;0,6\n1;0\n",
        b"0.000e+00 0.0\n1e-1  0.6\n1.0 0.0\n",
    ],
)
def test_a_file_of_numbers_is_read_to_the_last_line(tmp_path, data):
    assert read(tmp_path, data) == NUMBERS


@pytest.mark.parametrize(
    "data, words",
    [
        (b"", "numbers.csv has no line with a time and an angle"),
        (b"0.0,0.l\n" + GOOD, "line 1: '0.l' is no number"),
        (b"\xef\xbb\xbfO.0,O.0\n" + GOOD, "line 1: 'O.0' is no number"),
        (b"time\n" + GOOD, "line 1: every line must have a time and an angle, not 'time'"),
        (b"time,angle\ntime,angle\n" + GOOD, "line 2: 'time' is no number"),
        (GOOD + b"2.0,inf\n", "line 4: 'inf' is no finite number"),
        (GOOD + b"2.0,1e999\n", "line 4: '1e999' is no finite number"),
        (GOOD + b"\n\n2.0,1_0\n", "line 6: '1_0' is no number"),
        ("0,0\n1,٣\n".encode(), "line 2: '٣' is no number"),
        (b"0;0\n1.2,5;0\n", "line 2: '1.2,5' is no number"),
        (b'"0,0","0,1"\n', "line 1: '0,0' is no number, decimals follow a point"),
        (b"0,0\n,\n", "line 2: '' is no number"),
        (b"Gr\xf6\xdfe,Winkel\n" + GOOD, "line 1: this is no UTF-8 text"),
        (GOOD + b"2.0,\xb50\n", "line 4: this is no UTF-8 text"),
        (GOOD.decode().encode("utf-16"), "line 1: this is no UTF-8 text"),
        (GOOD.decode().encode("utf-16-le"), "line 1: there is a NUL byte"),
        (GOOD + b"2,\0\n", "line 4: there is a NUL byte"),
        (b"0,0\n1," + b"1" * (csv.field_size_limit() + 1), "line 2: this is no CSV: field larger than field limit"),
        (b"0,0\n1," + b"1" * 400, "1...' is no finite number"),
        (b'0,0\n1,"0\n2,0\n', "line 2: this is no CSV: unexpected end of data"),
    ],
)  # fmt: skip
def test_what_is_no_file_of_numbers_is_refused_with_its_line(tmp_path, data, words):
    with assert_refused(words):
        read(tmp_path, data)
    with pytest.raises(FileNotFoundError, match=r"^There is no file .*\.$"):
        read_rows(tmp_path)  # a folder


def test_numbers_are_in_the_units_that_names_say(tmp_path):
    file = tmp_path / "path.csv"
    for names, sides in (("x,y", (100.0, 50.0)), ("x (mm),y_cm", (0.1, 0.5)), ("left_x,right_x [m]", (100.0, 50.0))):
        file.write_text(f"{names}\n100,50\n")
        np.testing.assert_allclose(load_path(str(file)), [sides])
    file.write_text("x (px),y (px)\n100,50\n")
    with assert_refused("path.csv: 'x (px)' must be in m, cm, mm."):
        load_path(str(file))


def test_a_file_of_more_lines_than_are_read_is_refused(tmp_path):
    (tmp_path / "long.csv").write_text("1,2\n" * 1001)
    assert len(read_rows(tmp_path / "long.csv", 1001)) == 1001
    with assert_refused("long.csv has more than 1,000 lines"):
        read_rows(tmp_path / "long.csv", 1000)
