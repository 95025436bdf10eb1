"""Checks of what `pcsr` makes of small inputs with troubles, by the name of the file, for `cases.py`."""

import re
from collections.abc import Callable
from functools import partial

import numpy as np
from case_runs import Case, pcsr
from scipy.spatial import cKDTree

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud

BETWEEN = 0.2
"""A point hangs inside a plate if it is farther from both sheets than this share of the thickness."""

Verdict = tuple[bool, str]
"""Whether a file is ok, and what happened."""


def read(case: Case, *options: str, word: bool = False, refusable: bool = False) -> Verdict:
    """The result begins with the plain cloud; `word`: something is said; `refusable`: one line of refusal will do."""
    done, expected = case.upsample(*options), case.plain()
    if refusable and done.refused:
        return True, f"refused: {done.said}"
    points = done.cloud().points[: len(expected)]
    if points.shape != expected.shape or not np.allclose(points, expected, atol=1e-6):
        return False, f"misread: begins with {points[0].round(3).tolist()}, not {expected[0].round(3).tolist()}"
    return bool(done.said) or not word, f"read: {done.said or 'not a word'}"


def colmap(case: Case) -> Verdict:
    """Read as it is, or by the option that the refusal names."""
    done = case.upsample()
    if not done.code:
        return read(case)
    good, what = read(case, "--format", "colmap")
    return good and done.refused and "--format" in done.said, f"{done.said}; with it {what}"


def columns(case: Case, *names: str) -> Verdict:
    """`--columns` names the columns; without it they are not named, or what was guessed is said."""
    option = "--columns", ",".join(("x", "y", "z", *names))
    good, what = read(case, *option)
    named, plain = case.upsample(*option).cloud(), case.upsample()
    guessed = set(names) & set(plain.cloud().columns)
    good = good and set(names) <= set(named.columns) and bool(plain.said or not guessed)
    return good, f"with --columns {what}; without: {plain.said or 'not a word'}"


def sick(case: Case, healthy: Callable[[np.ndarray], np.ndarray], count: str, harmful: bool = True) -> Verdict:
    """The count is said, and `--bad drop` gives what the healthy points give alone.

    By default harmful points are refused, and others have no influence on the new points.
    """
    first, dropped = case.upsample(), case.upsample("--bad", "drop", suffix=".xyz").cloud().points
    expected = case.upsampled(healthy(read_cloud(case.path, bad="keep").points))
    same = dropped.shape == expected.shape and np.allclose(dropped, expected, atol=1e-4)
    if same and not harmful:
        new = len(expected) * 3 // 4
        same = np.allclose(first.cloud().points[-new:], expected[-new:], atol=1e-4)
    good = count in first.said and first.refused == harmful and same
    return good, first.said + ("" if same else "; new points are not those of the healthy points")


def flying(case: Case) -> Verdict:
    """Flying pixels get no more new points than others."""
    given, done = read_cloud(case.path), case.upsample()
    new = done.cloud().points[len(given) :]
    count = np.bincount(cKDTree(given.points).query(new)[1], minlength=len(given))
    flyer = given.columns["flyer"].astype(bool)
    here, elsewhere = count[flyer].mean(), count[~flyer].mean()
    return bool(here <= elsewhere), f"{here:.2f} new points at each, {elsewhere:.2f} elsewhere"


def classes(case: Case) -> Verdict:
    made = np.unique(case.upsample().cloud().columns["scalar_Classification"])
    return set(made) <= {2, 6}, f"classes {made[:6].round(2).tolist()}"


def rotations(case: Case) -> Verdict:
    """Quaternions have length 1 and are a mean of those of the neighbours, or they are left out with a word."""
    given, done = read_cloud(case.path), case.upsample()
    dense, names = done.cloud(), [f"rot_{i}" for i in range(4)]
    if not set(names) <= set(dense.columns):
        return "rot_" in done.said, f"left out: {done.said or 'without a word'}"
    old, new = (stacked(one, names)[start:] for one, start in ((given, 0), (dense, len(given))))
    near = cKDTree(given.points).query(dense.points[len(given) :], k=3)[1]
    turn = angles(old[near[:, 0]], new)
    among = np.max([angles(old[near[:, 0]], old[near[:, i]]) for i in (1, 2)], axis=0)
    length = np.linalg.norm(new, axis=1)
    good = bool(np.abs(length - 1).max() < 1e-3 and (turn <= among + 1).all())
    return good, f"length {length.min():.3f} to {length.max():.3f}, turned by up to {2 * turn.max():.0f}°"


def normals(case: Case) -> Verdict:
    """New normals lie near the line of the nearest given one, whatever the signs."""
    given, dense = read_cloud(case.path), case.upsample().cloud()
    nearest = cKDTree(given.points).query(dense.points[len(given) :])[1]
    old, new = (stacked(cloud, ["nx", "ny", "nz"]) for cloud in (given, dense))
    off = angles(old[nearest], new[len(given) :]).max()
    return bool(off < 30), f"up to {off:.0f}° off the line of the nearest given normal"


def stacked(cloud: Cloud, names: list[str]) -> np.ndarray:
    return np.stack([cloud.columns[name] for name in names], axis=1).astype(np.float64)


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between lines through the origin, in degrees."""
    cosine = (one * other).sum(1) / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
    degrees: np.ndarray = np.degrees(np.arccos(np.clip(np.abs(cosine), 0, 1)))
    return degrees


def plate(case: Case) -> Verdict:
    given = read_cloud(case.path)
    z = case.upsample().cloud().points[len(given) :, 2]
    low, high = given.points[:, 2].min(), given.points[:, 2].max()
    inside = float((np.minimum(z - low, high - z) > BETWEEN * (high - low)).mean())
    return inside < 0.01, f"{inside:.1%} of the new points are inside"


def byte_colours(case: Case) -> Verdict:
    done = case.upsample()
    if done.code:
        return False, done.said
    header = done.out.read_bytes().partition(b"end_header")[0].decode()
    kinds = re.findall(r"property (\w+) (?:red|green|blue)\n", header)
    return kinds == ["uchar"] * 3, f"colours as {', '.join(kinds) or 'nothing'}"


def laz(case: Case) -> Verdict:
    """Written as LAZ, or refused before the work."""
    done = case.upsample(suffix=".laz")
    good = done.refused or len(done.cloud()) == 4 * len(read_cloud(case.path))
    return good, f"{'refused' if done.code else 'LAZ'}: {done.said or 'not a word'}"


def units(case: Case) -> Verdict:
    said = pcsr("evaluate", str(case.path), str(case.path.with_name("ev_b.xyz")), "--metric", "cd").stderr.strip()
    factors = [float(number.replace(",", "")) for number in re.findall(r"\d[\d,.]*\d", said)]
    return any(900 < factor < 1100 for factor in factors), said or "not a word"


WORD, REFUSABLE = partial(read, word=True), partial(read, refusable=True)
CHECKS: dict[str, Callable[[Case], Verdict]] = {
    "german_crlf.xyz german_int.xyz colmixed.obj": REFUSABLE,
    "list_view.ply names.csv trailing.csv empty_attr.csv": WORD,
    "german.csv semicolon.csv cc_semicolon.txt points3D_notrack.txt lower.pcd nocount.pcd upper.pcd": read,
    "utf16.csv latin1.txt leica.pts leica.ptx scan.asc": read,
    "points3D.bin": colmap,
    "depth_zeros.ply": partial(sick, healthy=lambda p: p[p.any(axis=1)], count="753 of 2500 points"),
    "sentinel.xyz": partial(sick, healthy=lambda p: p[:-1], count="1 of 401 points"),
    "nan_win.xyz": partial(sick, healthy=lambda p: p[np.isfinite(p).all(axis=1)], count="of 400 points"),
    "dup8.xyz": partial(sick, healthy=lambda p: p[::8], count="2800 of 3200 points", harmful=False),
    "flyers.ply": flying,
    "cc_scalar.ply": classes,
    "splat.ply": rotations,
    "normals_mixed.ply": normals,
    "xyzrgb.txt": lambda case: columns(case, "red", "green", "blue"),
    "xyznormal.xyz": lambda case: columns(case, "nx", "ny", "nz"),
    "plate.ply": plate,
    "col01.obj als14.las": byte_colours,
    "fake.copc.laz": laz,
    "ev_a_mm.xyz": units,
}
"""The check of each file."""
