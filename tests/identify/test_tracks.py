"""Files of trackers, with their headers as the tools write them, become trajectories that `identify` reads."""

import math
import pickle
import sys
import zlib
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from refusals import assert_refused, assert_told
from seastar_gym import Body, Scene, Seastar
from seastar_gym.cli.main import main
from seastar_gym.identify import Measurement
from seastar_gym.identify.measurement import ORIENTATION, pointer
from seastar_gym.identify.tracks import Track, read_deeplabcut, read_motive, read_sleap, read_table
from seastar_gym.identify.tracks.track import Seen, from_rest, homography, mapped, read_homography, seen_nodes, turned

POSE = "time,x,y,theta\n0,0.1,0.2,0.3\n0.033,,,\n0.067,nan,NaN,nan\n0.1,0.11,0.2,0.31\n"
TRACKS = Path(__file__).parents[1] / "data" / "tracks"
DEEPLABCUT, SEVERAL, SLEAP, MOTIVE, MOTIVE_WITH_PARENTS = (
    (TRACKS / f"{name}.csv").read_text(encoding="utf-8")
    for name in ("deeplabcut", "deeplabcut_two_animals", "sleap", "motive", "motive_with_parents")
)


def written(folder, name, text):
    (folder / name).write_text(text)
    return folder / name


def sleap_h5(folder, name, text):
    """HDF5 file of two animals with two points, in three pictures."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed (extra tracks)")
    with h5py.File(folder / name, "w") as file:
        file["tracks"] = np.arange(24.0).reshape(2, 2, 2, 3)
        file["node_names"], file["track_names"] = [b"hub", b"tip"], [b"a", b"b"]
    return folder / name


READ = {
    "pose.csv": (POSE, read_table), "place.csv": ("time,x,y\n0,1,2\n", read_table),
    "deeplabcut.csv": (DEEPLABCUT, lambda file: read_deeplabcut(file, 30.0)),
    "deeplabcut_unlikely.csv": (DEEPLABCUT, lambda file: read_deeplabcut(file, 30.0, likelihood=0.2)),
    "deeplabcut_b.csv": (SEVERAL, lambda file: read_deeplabcut(file, 30.0, "b")),
    "deeplabcut_semicolons.csv": (
        "\ufeff" + DEEPLABCUT.replace(",", ";").replace(".", ","), lambda file: read_deeplabcut(file, 30.0)),
    "sleap.csv": (SLEAP, lambda file: read_sleap(file, 10.0)),
    "sleap_likely.csv": (SLEAP, lambda file: read_sleap(file, 10.0, likelihood=0.5)),
    "sleap.h5": ("", lambda file: read_sleap(file, 10.0, "b")),
    "motive.csv": (MOTIVE, read_motive), "motive_z.csv": (MOTIVE, lambda file: read_motive(file, "z")),
    "motive_with_parents.csv": (MOTIVE_WITH_PARENTS, read_motive),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_files_are_read_in_the_order_of_their_pictures_and_what_was_not_seen_is_nan(tmp_path, name, golden):
    """Motive's from above in metres: half a turn about the upward axis is to the left; measured markers are taken."""
    text, read = READ[name]
    track = read((sleap_h5 if name.endswith("h5") else written)(tmp_path, name, text))
    with np.printoptions(precision=9, suppress=True):
        lines = [f"time {track.time}"]
        lines += [f"{kind} {point}\n{each}" for kind in ("points", "orientations")
                  for point, each in getattr(track, kind).items()]  # fmt: skip
    golden(f"{name}.txt", "\n".join(lines))


def test_hdf5_without_h5py_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "h5py", None)
    given = ["--from", "sleap", "--out", str(tmp_path / "out.csv"), "--rate", "30", "--metres-per-pixel", "0.001"]
    assert main(["track2csv", str(tmp_path / "sleap.h5"), *given]) == 2
    assert_told(capsys, 'need h5py: pip install "seastar-gym[tracks]"')


@pytest.mark.parametrize("form", ["table", "fixed"])
@pytest.mark.parametrize("text, individual", [(DEEPLABCUT, None), (SEVERAL, "b")])
def test_deeplabcut_s_own_hdf5_is_read_as_its_csv(tmp_path, text, individual, form):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed (extra tracks)")
    pytest.importorskip("tables", reason="PyTables is not installed (extra tracks)")
    file = written(tmp_path, "dlc.csv", text)
    table = pandas.read_csv(file, header=[0, 1, 2, *([3] if individual else [])], index_col=0)
    table.to_hdf(tmp_path / "dlc.h5", key="df_with_missing", format=form, mode="w")
    expected, track = (read_deeplabcut(each, 30.0, individual) for each in (file, tmp_path / "dlc.h5"))
    np.testing.assert_array_equal(track.time, expected.time)
    assert track.points.keys() == expected.points.keys()
    for name, places in expected.points.items():
        np.testing.assert_array_equal(track.points[name], places)


HARMFUL = {
    "16 TiB": (lambda file, _: file.create_dataset("tracks", (2**10, 2, 2**10, 2**20), "f8", chunks=(1, 2, 16, 512)),
               "with /tracks it declares 17,592,186,044,416 bytes"),
    "many of some": (lambda file, _: [file.create_dataset(str(k), (200_000,), "f8") for k in range(99)], "it declares"),
    "a chunk": (lambda file, _: file.create_dataset("a", (1,), "f8", maxshape=(None,), chunks=(2**28,)), "it declares"),
    "long names": (lambda file, _: file.create_dataset("a", (2**20,), "S9999"), "it declares"),
    "elsewhere": (lambda file, other: file.create_dataset("tracks", (10,), "f8", external=other), "in other files"),
    "virtual": (lambda file, other: virtual(file, other), "in other files"),
    "soft": (lambda file, _: file.__setitem__("a", h5("SoftLink")("/b")), "a is a link to elsewhere"),
    "outside": (lambda file, other: file.create_group("in").__setitem__("a", h5("ExternalLink")(other, "/b")),
                "a is a link to elsewhere"),
    "reference": (lambda file, _: file.create_dataset("a", (1,), h5("ref_dtype")), "references"),
    "region": (lambda file, _: file.create_dataset("a", (1,), h5("regionref_dtype")), "references"),
    "rows": (lambda file, _: file.create_dataset("a", (1,), h5("vlen_dtype")(float)), "rows of any length"),
    "in a record": (lambda file, _: file.create_dataset("a", (1,), [("b", h5("string_dtype")())]), "of any length"),
    "an attribute's": (lambda file, _: file.attrs.__setitem__("a", file.ref), "references"),
    "a pickle": (lambda file, _: file.attrs.__setitem__("a", np.bytes_(pickle.dumps(print, 0))), "would run code"),
    "objects": (lambda file, _: file.__setitem__("a", np.void(b"cos")), "objects"),
    "a type": (lambda file, _: file.__setitem__("a", np.dtype("f8")), "neither a folder nor a data set"),
    "sets": (lambda file, _: [file.create_group(str(k)) for k in range(1001)], "more than 1,000"),
    "attributes": (lambda file, _: [file.attrs.__setitem__(str(k), 1) for k in range(1001)], "more than 1,000"),
    "texts": (lambda file, _: file.__setitem__("a", ["a"] * 1001), "more than 1,000 texts"),
    "long texts": (lambda file, _: file.__setitem__("a", ["a" * 2000] * 999), "longer than 1,000,000 bytes"),
    "bomb": (lambda file, _: packed(file, zlib.compress(bytes(10**8))), "unpacks to more than it declares"),
    "another packing": (lambda file, _: file.create_dataset("a", (9,), "f8", compression="lzf"), "once by gzip"),
}  # fmt: skip


def h5(name):
    return getattr(pytest.importorskip("h5py", reason="h5py is not installed (extra tracks)"), name)


def virtual(file, other):
    layout = h5("VirtualLayout")((10,), float)
    layout[:] = h5("VirtualSource")(other, "a", (10,))
    file.create_virtual_dataset("tracks", layout)


def packed(file, data):
    file.create_dataset("tracks", (1000,), "f8", chunks=(1000,), compression="gzip").id.write_direct_chunk((0,), data)


@pytest.mark.parametrize("name", HARMFUL)
def test_hdf5_that_could_do_harm_is_refused_before_it_is_read(tmp_path, name):
    make, words = HARMFUL[name]
    (tmp_path / "private").write_text("secret")
    with h5("File")(tmp_path / "sleap.h5", "w") as file:
        make(file, str(tmp_path / "private"))
    with assert_refused("is refused before it is read", words):
        read_sleap(tmp_path / "sleap.h5", 10.0)


def test_hdf5_as_trackers_write_it_is_read(tmp_path):
    """Packed, with checksums, texts of any length, records, flags, a hard link twice and one in a circle."""
    tracks = np.where(np.random.default_rng(0).random((1, 2, 2, 5000)) < 0.5, np.nan, 1.0)
    with h5("File")(tmp_path / "sleap.h5", "w") as file:
        packing = {"compression": "gzip", "shuffle": True, "fletcher32": True}
        file.create_dataset("tracks", data=tracks, **packing)
        file.create_dataset("track_occupancy", data=np.full((10_000, 1), np.nan), **packing)
        file["node_names"], file["track_names"], file["labels_path"] = ["hub", "tip"], ["a"], "C:/labels.slp"
        file.create_group("more")["table"] = np.zeros(3, [("a", float), ("b", "S3"), ("c", float, (2,)), ("d", bool)])
        file["again"], file["more/all"], file["none"] = file["tracks"], file["/"], h5("Empty")("f")
        file.attrs["plain"] = np.bytes_(pickle.dumps([(1, ["hub", None]), {"a": 1.5}], 0))
        file.attrs["words"], file.attrs["numbers"] = ["a", "b"], [1, 2]
    track = read_sleap(tmp_path / "sleap.h5", 10.0)
    np.testing.assert_array_equal(track.points["tip"], tracks[0, :, 1].T)


CORNERS = np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.3], [0.0, 0.3]])


def pixels_of(metres):
    """Pixels of a camera that looks down from the side, shape (n, 2)."""
    matrix = np.array([[2000.0, 300.0, 640.0], [100.0, -1800.0, 480.0], [0.1, 0.4, 1.0]])
    return mapped(matrix, metres)


def test_four_points_tell_the_plane_of_a_camera_that_looks_from_the_side(tmp_path):
    rng = np.random.default_rng(0)
    inside = rng.uniform(0.0, 0.3, (20, 2))
    found = homography(pixels_of(CORNERS), CORNERS)
    np.testing.assert_allclose(mapped(found, pixels_of(inside)), inside, atol=1e-12)
    many = homography(pixels_of(inside), inside)
    np.testing.assert_allclose(mapped(many, pixels_of(CORNERS)), CORNERS, atol=1e-12)
    noisy = pixels_of(inside) + rng.normal(size=(20, 2))  # wherever pixels are counted from
    here, there = (mapped(homography(noisy + begin, inside), noisy + begin) for begin in (0.0, [1e4, 0.0]))
    np.testing.assert_allclose(there, here, atol=1e-9)
    lines = [",".join(f"{x:.12g}" for x in row) for row in np.hstack([pixels_of(CORNERS), CORNERS])]
    file = written(tmp_path, "corners.csv", "u,v,x,y\n" + "\n".join(lines) + "\n")
    np.testing.assert_allclose(mapped(read_homography(file), pixels_of(inside)), inside, atol=1e-9)


def test_directions_are_mapped_as_short_lines_are():
    plane = homography(pixels_of(CORNERS), CORNERS)
    points, angles = np.array([[600.0, 400.0], [900.0, 300.0]]), np.array([0.4, -2.0])
    ahead = points + 1e-4 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    x, y = (mapped(plane, ahead) - mapped(plane, points)).T
    np.testing.assert_allclose(turned(plane, points, angles), np.arctan2(y, x), atol=1e-6)
    track = Track(np.zeros(1), {"tag": np.array([[100.0, 200.0]])}, {"tag": np.array([0.5])}, in_pixels=True)
    track = track.in_metres(1e-3)
    np.testing.assert_allclose(track.points["tag"], [[0.1, -0.2]])  # pictures have y down
    np.testing.assert_allclose(track.orientations["tag"], [-0.5])


def test_a_robot_that_begins_anywhere_is_brought_to_the_origin():
    """By two nodes or more, or by a tag."""
    robot = Seastar(nodes_per_limb=4, body=Body(radius=0.02))
    scene, nodes = Scene(robot), (3, 6, 9)
    c, s = math.cos(2.5), math.sin(2.5)
    rotation = np.array([[c, s], [-s, c]])
    shape, place = robot.nodes(), np.array([0.3, -0.2])
    time, moved = np.arange(4.0), np.linspace(0.0, 0.1, 4)[:, None, None]
    for seen in (nodes, (0, ORIENTATION)):
        before = np.stack([pointer(np.zeros(4)) if k == ORIENTATION else shape[k] + moved[:, 0] for k in seen], axis=1)
        lab = before @ rotation + np.where(np.array(seen)[:, None] == ORIENTATION, 0.0, place)
        lab[1, 0] = np.nan
        found = from_rest(Seen(lab, seen), time, 0.0, scene)
        np.testing.assert_allclose(found.positions[[0, 2, 3]], before[[0, 2, 3]], atol=1e-12)
    still = np.tile(shape[list(nodes)] @ rotation, (4, 1, 1)) + 1e-3 * np.array([1, -1, 1, -1])[:, None, None]
    found = from_rest(Seen(still, nodes), time, 5.0, scene)
    np.testing.assert_allclose(found.positions.mean(axis=0), shape[list(nodes)], atol=1e-12)


def no_plane(points):
    return lambda file: homography(np.array(points, float), np.array(points, float))


LOST = np.array([[[np.nan, np.nan]], [[0.0, 0.0]]])
NOTHING = Track(np.zeros(1), {"a": np.zeros((1, 2)), "b": np.zeros((1, 2))}, {})
HORIZON = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, -1.0, 0.0]])
REFUSED = [
    (read_table, "time,x,y,theta\n0,0,0,\n0.1,0,0,90\n", "begins at 90 rad, beyond a full turn: it may be in degrees."),
    (lambda file: read_deeplabcut(file, 30.0), SEVERAL, "has the individuals a, b: name one"),
    (lambda file: read_deeplabcut(file, 30.0, "a"), DEEPLABCUT, "names no individuals: leave --individual out"),
    (lambda file: read_sleap(sleap_h5(file.parent, "sleap.h5", ""), 10.0), "", "has the individuals a, b"),
    pytest.param(
        lambda file: read_sleap(file.rename(file.with_suffix(".h5")), 10.0), "x", "h5 is no HDF5 file that can be read",
        marks=pytest.mark.skipif(find_spec("h5py") is None, reason="needs h5py"),
    ),
    (read_table, "time,x\n0,1\n", "file.csv has no column 'y', but time, x."),
    (read_table, "Zeit;x;y\n0,0;1;2\n", "separated by semicolons or tabs, has no column 'time', but Zeit, x, y."),
    (read_table, "time,x,x,y\n0,1,2,3\n", "has several columns 'x': have more lines of names read, with --headers."),
    (read_table, "time,x,y\n", "must have names, and lines below them"),
    (read_table, "time,x,y\n0,1\n", "line 2: the line must have 3 fields"),
    (read_table, "time,x,y\n0,one,2\n", "line 2: 'one' is no number"),
    (read_table, "time,x,y\n0,1,2\n0,3,4\n", "Picture 1 is of 0 s and picture 2 of 0 s: give one line for every"),
    (lambda file: read_sleap(file, 30.0), SLEAP + SLEAP.splitlines()[1], "Picture 1 is of 0 s and picture 2 of 0 s"),
    (lambda file: read_table(file, x=["x", "z"]), "time,x,y\n0,1,2\n", "Every x needs a y"),
    (lambda file: read_table(file, score="s"), "time,x,y\n0,1,2\n", "--score and --likelihood belong together."),
    (lambda file: read_table(file, only={"id": "4"}), "time,id,x,y\n0,3,1,2\n", "has no line with id=4."),
    (lambda file: read_table(file, x="x (inch)"), "time,x (inch),y\n0,1,2\n", "is in none of m, cm, mm: give its unit"),
    (lambda file: read_table(file, time="t (since 8h)"), "t (since 8h),x,y\n0,1,2\n", "give its unit by --time-unit."),
    (lambda file: read_table(file, rate=10.0, time_unit="s"), POSE, "With --rate, pictures are counted"),
    (lambda file: read_table(file).since(9.0), POSE, "All pictures are from before 9 s: the last one is of 0.1 s."),
    (lambda file: read_table(file).in_metres(1e-3), POSE, "The track is in metres, not in pixels"),
    (lambda file: read_table(file, unit="px").in_metres(), POSE, "or by --homography, not both."),
    (lambda file: read_table(file, unit="px").seen(Scene()), POSE, "The track is in pixels"),
    (lambda _: Track.from_movement({}), "", "dataset must be one of poses, as movement has them, not {}."),
    (lambda _: Track.from_movement(movement(time_unit="frames")), "", "times are numbers of frames: load it with fps."),
    (lambda _: Track(np.zeros(0), {}, {}), "", "There are no pictures."),
    (lambda file: read_deeplabcut(file, 1.0), POSE, "has no lines scorer, bodyparts and coords"),
    (lambda file: read_deeplabcut(file, 1.0), DEEPLABCUT[:-1] + ",9\n", "line 6: the line must have 7 fields"),
    (lambda file: read_deeplabcut(file, 1.0), "scorer,s\nbodyparts,a\ncoords,x\n0,1\n", "x, y and likelihood"),
    (lambda file: read_sleap(file, 1.0), POSE, "the first line must be track,frame_idx,"),
    (lambda file: read_sleap(file, 1.0), SLEAP[:-1] + "1\n" + "track_0,4\n", "line 5: the line must have 9 fields"),
    (read_table, "time,x,y\n0,1,2\n1,1e308,2\n", "In picture 2, the place of x is [1.e+308 2.e+000]"),
    (read_table, "time,x,y,theta\n0,1,2,-1e308\n", "the orientation of x is -1e+308: nothing is beyond 1e+06"),
    (read_motive, MOTIVE.replace("0.8660254", "1e200"), "the quaternion of Seastar is"),
    (read_homography, "x,y,u [px],v\n0,0,0,0\n", "columns must be u,v,x,y, in this order"),
    (read_homography, "0,0,0,0\n1,0,1,0\n0,1,0,1\n1,1,1e200,1\n", "no pixel and no place is beyond 1e+06"),
    (lambda _: Track(np.zeros(1), {"a": np.array([[1.0, 1.0]])}, {}).mapped(HORIZON), "", "the place of a is [inf"),
    (read_motive, POSE, "has no types, names and Position"),
    (read_motive, MOTIVE.replace("Millimeters", "Feet"), "line 1: Format Version and Length Units must be there"),
    (read_motive, MOTIVE.replace("Z,W,", "Z,,"), "export it with the rotation type Quaternion"),
    (no_plane([[0, 0], [1, 0], [0, 1]]), "", "needs four points or more, not 3"),
    (no_plane([[0, 0], [1, 0], [2, 0], [0, 1]]), "", "no three of four may be on one line"),
    (lambda _: from_rest(Seen(np.zeros((2, 1, 2)), (0,)), np.arange(2.0), 0.0, Scene()), "",
     "does not tell the direction of limb 1"),
    (lambda _: from_rest(Seen(LOST, (0,)), np.arange(2.0), 0.0, Scene()), "",
     "No node was seen while the robot was at rest, in the first 0 s"),
    (lambda _: seen_nodes(NOTHING, {"c": 0}), "", "There is no point c: the file has a, b."),
    (lambda _: seen_nodes(NOTHING, {"a": 0, "b": 0}), "", "Two points cannot be one node: a=0, b=0."),
]  # fmt: skip


@pytest.mark.parametrize("read, text, words", REFUSED)
def test_files_of_another_form_and_what_they_do_not_tell_are_refused(tmp_path, read, text, words):
    with assert_refused(words):
        read(written(tmp_path, "file.csv", text))


def converted(tmp_path, text, *given):
    """Exit code and the trajectory of a command with this file."""
    code = main(["track2csv", str(written(tmp_path, "file.csv", text)), "--out", str(tmp_path / "out.csv"), *given])
    return code, (tmp_path / "out.csv").read_text() if code == 0 else None


def with_body(tmp_path):
    """Options of a robot with a body, whose orientation is tracked."""
    scene = "from seastar_gym import Body, Scene, Seastar\nscene = Scene(Seastar(body=Body(radius=0.02)))\n"
    (tmp_path / "body.py").write_text(scene)
    return ["--scene", str(tmp_path / "body.py")]


def test_trackers_poses_and_markers_become_nodes_and_the_hub_s_orientation(tmp_path, golden):
    for name, text, given in (
        ("pose_turned", POSE, ["--from", "table"]), ("pose_aligned", POSE, ["--from", "table", "--aligned"]),
        ("any_node", MOTIVE, ["--from", "motive", "--aligned", "--nodes", "Seastar:Marker 001=tip1", "Seastar=hub"]),
    ):  # fmt: skip
        code, csv = converted(tmp_path, text, *given, *with_body(tmp_path))
        assert code == 0
        rounded = (",".join(f"{float(x):.6f}" if x else "" for x in line.split(",")) for line in csv.splitlines()[1:])
        golden(f"{name}.csv", "\n".join([csv.splitlines()[0], *rounded]))


# The files of one swim, as laboratories have them: each becomes the same trajectory.

TIME = np.arange(6) / 20.0
TURN = 2.1 + np.linspace(0.0, 0.3, 6)
HUB = np.array([0.4, 0.3]) + np.linspace(0.0, 0.02, 6)[:, None] * [1.0, 0.5]
TIP = HUB + 0.1 * np.stack([np.cos(TURN), np.sin(TURN)], axis=1)
POINTS = ["--nodes", "{0}=hub", "{1}=tip1"]


def lines(names, *columns, separator=",", decimal=".", form="{:.9g}"):
    """Text of a file: lines of names, and columns of numbers or texts."""
    rows = (separator.join(form.format(x).replace(".", decimal) if isinstance(x, float) else str(x) for x in row)
            for row in zip(*columns, strict=True))  # fmt: skip
    return "\n".join([*names, *rows, ""])


def ros(_):
    half = 0.5 * TURN
    none = ["0"] * 6
    stamps = [str(1_700_000_000_000_000_000 + round(1e9 * t)) for t in TIME]
    names = "%time,field.header.frame_id," + ",".join(f"field.pose.position.{axis}" for axis in "xyz")
    names += "," + ",".join(f"field.pose.orientation.{axis}" for axis in "xyzw")
    columns = stamps, ["map"] * 6, *HUB.T, none, none, none, np.sin(half), np.cos(half)
    given = ["--time", "%time", "--time-unit", "ns", "--begin", "first"]
    given += ["--x", "field.pose.position.x", "--y", "field.pose.position.y"]
    return lines([names], *columns), [*given, "--theta", *(f"field.pose.orientation.{axis}" for axis in "xyzw")]


def kinovea(_):
    text = lines(["Time (ms);Hub/X;Hub/Y;Tip/X;Tip/Y"], 1e3 * TIME, *HUB.T, *TIP.T, separator=";", decimal=",")
    return text, ["--time", "Time (ms)", "--x", "Hub/X", "Tip/X", "--y", "Hub/Y", "Tip/Y", *POINTS]


def kinovea_by_options(_):
    text, given = kinovea(_)
    return text, [*given, "--separator", ";", "--decimal", ",", "--time-unit", "ms", "--unit", "m"]


def vicon(_):
    heads = ["Trajectories", "20", ",,Star:Hub,,,Star:Tip,,", "Frame,Sub Frame,X,Y,Z,X,Y,Z", ",,mm,mm,mm,mm,mm,mm"]
    zero = ["0"] * 6
    text = lines(heads, range(1, 7), zero, *1e3 * HUB.T, zero, *1e3 * TIP.T, zero)
    given = ["--skip", "2", "--headers", "3", "--rate", "20", "--time", "Frame", "--begin", "first"]
    return text, [*given, "--x", "Star:Hub.X.mm", "Star:Tip.X.mm", "--y", "Star:Hub.Y.mm", "Star:Tip.Y.mm", *POINTS]


def tracker(_):
    text = lines(["mass_A\t\tmass_B\t", "t\tx\ty\tx_2\ty_2"], TIME, *1e2 * HUB.T, *1e2 * TIP.T, separator="\t")
    text = text.replace("mass_A\t\tmass_B\t", "mass_A\t\t\tmass_B\t")
    given = ["--headers", "2", "--time", "mass_A.t", "--unit", "cm", "--separator", "tab"]
    return text, [*given, "--x", "mass_A.x", "mass_B.x_2", "--y", "mass_A.y", "mass_B.y_2", *POINTS]


def trex(_):
    lost = np.array([*1e2 * HUB.T[0], math.inf])
    columns = [*range(7)], np.append(TIME, 0.3), lost, np.append(-1e2 * HUB.T[1], math.inf), np.append(-TURN, math.inf)
    text = lines(["frame,time,X#wcentroid (cm),Y#wcentroid (cm),ANGLE"], *columns)
    return text, ["--x", "X#wcentroid (cm)", "--y", "Y#wcentroid (cm)", "--theta", "ANGLE", "--y-down"]


def tags(_):
    both = [3, 7] * 6
    time, turn, x, y = (np.repeat(each, 2) for each in (TIME, np.degrees(TURN), *1e3 * HUB.T))
    text = "\ufeff" + lines(['"Tag id","Unix time","x (mm)","y (mm)","yaw (deg)"'], both, time + 1.7e9, x, y, turn,
                            form="{:.12g}")  # fmt: skip
    given = ["--only", "Tag id=7", "--time", "Unix time", "--begin", "1.7e9"]
    return text, [*given, "--x", "x (mm)", "--y", "y (mm)", "--theta", "yaw (deg)"]


def frames(_):
    text = lines(["x,y,angle,score"], *HUB.T, TURN, [1.0] * 5 + [0.1])
    return text, ["--rate", "20", "--theta", "angle", "--score", "score", "--likelihood", "0.5"]


@pytest.mark.parametrize("made", [ros, kinovea, kinovea_by_options, vicon, tracker, trex, tags, frames])
def test_one_swim_is_the_same_whatever_has_tracked_it(tmp_path, made):
    text, given = made(None)
    if "--nodes" in given:
        names = given[given.index("--x") + 1 :][:2]
        given = [each.format(*names) for each in given]
    has_tip = "--nodes" in given
    code, csv = converted(tmp_path, text, "--from", "table", *given, *([] if has_tip else with_body(tmp_path)))
    assert code == 0
    c, s = np.cos(TURN[0]), np.sin(TURN[0])
    turned_back = np.array([[c, -s], [s, c]])
    places = [(HUB - HUB[0]) @ turned_back, *([(TIP - HUB[0]) @ turned_back] if has_tip else [TURN[:, None] - TURN[0]])]
    expected = np.column_stack([TIME, *places])
    if made is frames:
        expected[-1, 1:3] = np.nan
    names, *rows = csv.splitlines()
    assert names == ("time,x0,y0,x11,y11" if has_tip else "time,x0,y0,theta")
    found = np.array([[float(x or "nan") for x in row.split(",")] for row in rows])
    if made is trex:
        assert np.isnan(found[-1, 1:]).all()
    np.testing.assert_allclose(found[: len(expected)], expected, atol=2e-6)


def test_an_orientation_tells_where_a_robot_without_a_body_begins_and_is_left_out(tmp_path, capsys):
    code, csv = converted(tmp_path, "time,x,y,theta\n0,0.1,0.2,0.3\n0.1,0.2,0.2,0.3\n", "--from", "table")
    assert code == 0 and "orientation, which is that of a body, is left out." in capsys.readouterr().out
    names, _, last = csv.splitlines()
    assert names == "time,x0,y0"
    expected = 0.1 * np.array([math.cos(0.3), -math.sin(0.3)])
    np.testing.assert_allclose(np.array(last.split(",")[1:], float), expected, atol=1e-6)


def test_pictures_from_before_the_begin_are_left_out_and_counted(tmp_path, capsys):
    code, csv = converted(tmp_path, POSE, "--from", "table", "--begin", "0.1")
    assert code == 0 and csv.splitlines()[1].startswith("0.0,0,0") and len(csv.splitlines()) == 2
    assert "1 pictures in 0 s" in (said := capsys.readouterr().out) and "3 pictures from before were left out." in said


class Labelled:
    """What is used of an array of xarray: its dimensions, their coordinates and their order."""

    def __init__(self, values, coords):
        self.values, self.coords, self.dims = np.asarray(values), coords, tuple(coords)

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.values, dtype)

    def transpose(self, *dims):
        order = [self.dims.index(name) for name in dims]
        return Labelled(self.values.transpose(order), {name: self.coords[name] for name in dims})


class Dataset(dict):
    attrs = {}


def movement(ends="s", **attrs):
    """A dataset of poses with the dimensions that `movement` has, before version 0.17 in the plural."""
    coords = {"time": TIME, "space": ["x", "y"], f"keypoint{ends}": ["mid", "end"], f"individual{ends}": ["a", "b"]}
    places = np.stack([np.stack([HUB, TIP], axis=2), np.zeros((6, 2, 2))], axis=3)
    sure = np.ones((6, 2, 2))
    sure[3, 1, 0] = 0.1
    of_points = {name: coords[name] for name in coords if name != "space"}
    places *= 1e4 * np.array([1.0, -1.0])[:, None, None]
    dataset = Dataset(position=Labelled(places, coords), confidence=Labelled(sure, of_points))
    dataset.attrs = {"time_unit": "seconds"} | attrs
    return dataset


@pytest.mark.parametrize("ends", ["s", ""])
def test_a_dataset_of_movement_becomes_a_trajectory(tmp_path, ends):
    track = Track.from_movement(movement(ends), individual="a").in_metres(1e-4)
    track.to_csv(tmp_path / "tracking.csv", Scene(), nodes={"mid": "hub", "end": "tip1"})
    (tmp_path / "commands.csv").write_text("0,0,0,0,0\n")
    measured = Measurement.from_csv(tmp_path / "tracking.csv", tmp_path / "commands.csv")
    assert measured.nodes == (0, 11) and np.isnan(measured.positions).nonzero()[0].tolist() == [3, 3]
    np.testing.assert_allclose(measured.positions[0], [[0.0, 0.0], [0.1, 0.0]], atol=1e-6)


@pytest.mark.parametrize(
    "text, given, words",
    [
        (POSE, ["--from", "table", "--up", "z"], "Files of table have no use for --up."),
        (POSE, ["--from", "table", "--only", "tag"], "--only must be such as id=3, not tag."),
        (POSE, ["--from", "table", "--begin", "now"], "--begin must be a time of the file or the word first, not now."),
        (DEEPLABCUT, ["--from", "deeplabcut"], "Files of deeplabcut have no times: give --rate"),
        (SLEAP, ["--from", "sleap", "--rate", "9", "--metres-per-pixel", "1e-3"], "Say which points are which nodes"),
        (POSE, ["--from", "table", "--unit", "px", "--metres-per-pixel", "1", "--homography", "x"], "not both"),
        (POSE, ["--from", "table", "--nodes", "tag"], "--nodes must be such as nose=hub"),
        (POSE, ["--from", "table", "--nodes", "x=tip"], "Nodes must be such as nose=hub, left=tip1 or left=11, not x"),
        (POSE, ["--from", "table", "--nodes", "x=tip6"], "x=tip6: the robot has 5 limbs and 56 nodes"),
    ],
)
def test_the_command_says_what_is_wrong_in_a_sentence(tmp_path, capsys, text, given, words):
    assert converted(tmp_path, text, *given) == (2, None)
    assert_told(capsys, words)
