"""`pcsr upsample` without touches, and with those of an arm that is off by 1 mm and 2°, as reported or registered.

python benchmarks/misplaced_touches.py [PART…] [--parts 24] [--keep FOLDER] [--picture FILE] [--save]

A part of 30 mm, 512 random points of its surface, and 4 touches of a DIGIT whose poses have normal errors, are written
as a cloud and a recording. Then the commands are run as a person would run them.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from click.testing import CliRunner
from jaxtyping import Float
from rich.progress import track
from saved import save, show
from touch_section import draw

import pcsr
from pcsr import cli
from pcsr.clouds.formats import read_points, write_points
from pcsr.errors import PcsrError, UserError
from pcsr.geometry.sampling import surface_points
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.noise import Noise

ERROR = pcsr.PoseError(position=1.0, rotation=2.0)
SIZE, POINTS, RATE, TOUCHES = 30.0, 512, 16, 4
MESH, CLOUD, REPORT = "part.stl", "cloud.ply", "report.json"
TOUCHED, UNVIEWED = "touches", "touches-without-view"
COMMANDS = {
    "without touches": (),
    "`--touch touches/ --touch-as-is`": ("--touch", TOUCHED, "--touch-as-is"),
    "`--touch touches/`": ("--touch", TOUCHED, "--touch-report", REPORT),
    "`--touch touches/`, without `view`": ("--touch", UNVIEWED),
}
"""Options of the commands."""
WORSE = 0.01
"""A part is worse with touches if its error is greater than without by more than this share."""
DRAWN = "test/clamp/0000", 1
"""Part and number of the touch in the picture."""


@dataclass(frozen=True)
class Scene:
    """A part as a robot sees and touches it, in a folder."""

    folder: Path
    item: pcsr.ShapeItem
    truth: Float[np.ndarray, "g 3"]

    @classmethod
    def write(cls, part: str, folder: Path, seed: int) -> "Scene":
        """Write the mesh, the cloud and the recordings of a part.

        Raises:
            UserError: the part cannot be touched.
        """
        item = CadParts().item(part)
        cloud = surface_points(item.mesh, POINTS, np.random.default_rng((seed, 0)))
        truth = surface_points(item.mesh, POINTS * RATE, np.random.default_rng((seed, 1)))
        noise = Noise(position_noise=ERROR.position, rotation_noise=ERROR.rotation)
        touches = Digit(object_size=SIZE, noise=noise).touches(item, cloud, TOUCHES, seed)
        folder.mkdir(parents=True, exist_ok=True)
        item.mesh.export(folder / MESH)
        write_points(folder / CLOUD, cloud)
        unviewed = [replace(touch, view=None) for touch in touches]
        for name, some in ((TOUCHED, touches), (UNVIEWED, unviewed)):
            pcsr.recorded.write(folder / name, some, overwrite=True, pose_error=ERROR)
        return cls(folder, item, truth)

    def upsampled(self, options: Sequence[str]) -> Float[np.ndarray, "n 3"]:
        """Return the result of `pcsr upsample`; the words in `options` that name files are files of the folder."""
        files = [str(self.folder / word) if word in (TOUCHED, UNVIEWED, REPORT) else word for word in options]
        out = self.folder / "dense.ply"
        words = ["upsample", str(self.folder / CLOUD), "-o", str(out), "--rate", str(RATE), "--jobs", "1", *files]
        done = CliRunner().invoke(cli.pcsr, words)
        if done.exit_code:
            raise UserError(f"pcsr {' '.join(words)}: {done.stderr.strip()}")
        return read_points(out)

    def error(self, options: Sequence[str]) -> float:
        """Return the Chamfer distance of the result, ×10³."""
        return 1e3 * pcsr.evaluate(self.upsampled(options), self.truth, metrics="cd")["cd"]


def rows(errors: Float[np.ndarray, "parts commands"]) -> list[list[str]]:
    """Return a row for each command, with its change against no touches; of two parts or more."""
    plain = errors[:, 0]
    made = [[next(iter(COMMANDS)), f"{plain.mean():.3f}", "", "", ""]]
    for command, values in zip(list(COMMANDS)[1:], errors.T[1:], strict=True):
        change = values - plain
        deviation = change.std(ddof=1) / np.sqrt(len(change))
        mean = f"{change.mean():+.3f} ± {deviation:.3f} ({change.mean() / plain.mean():+.1%})"
        counts = (f"{some.sum()}/{len(change)}" for some in (change < 0, change > WORSE * plain))
        made.append([command, f"{values.mean():.3f}", mean, *counts])
    return made


HEADS = (f"`pcsr upsample cloud.ply --rate {RATE} …`", "cd ×10³", "change ± standard error", "better")
HEADS += (f"worse by over {WORSE:.0%}",)


@click.command()
@click.argument("names", nargs=-1, metavar="[PART]...")
@click.option("--parts", type=click.IntRange(1), default=24, show_default=True, help="Number of parts, without PART.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--keep", type=click.Path(path_type=Path), default=None, help="Keep the files in this folder.")
@click.option("--picture", type=click.Path(path_type=Path), default=None, help="Only draw a touch to this PNG file.")
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/misplaced-touches.json, of several parts.")
def main(names: Sequence[str], parts: int, seed: int, keep: Path | None, picture: Path | None, *, saving: bool) -> None:
    """Print the error of each command, as a mean over parts of the test split, and of each part."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = keep or Path(temporary)
        try:
            if picture is not None:
                part, number = DRAWN
                scene = Scene.write(part, folder / part, seed)
                draw(scene.item.mesh, read_points(scene.folder / CLOUD), scene.folder / TOUCHED, number, picture)
                return
            measured = _measured(names or CadParts().names("test"), parts, folder, seed)
        except PcsrError as error:
            raise click.ClickException(str(error)) from error
    if not measured:
        raise click.ClickException("no part could be touched: name others")
    show(("part", *COMMANDS), [[name, *(f"{value:.3f}" for value in values)] for name, values in measured.items()])
    if len(measured) == 1:
        return
    table = rows(np.array(list(measured.values())))
    show(HEADS, table, f"{len(measured)} parts")
    if saving:
        words = "".join(f" {name}" for name in names) or f" --parts {parts}"
        save("misplaced-touches", f"python benchmarks/misplaced_touches.py{words} --seed {seed} --save", HEADS, table)


def _measured(names: Sequence[str], parts: int, folder: Path, seed: int) -> dict[str, list[float]]:
    """Return the errors of each part, in the order of `COMMANDS`, without parts that cannot be touched."""
    measured: dict[str, list[float]] = {}
    for name in track(names[:parts], "parts", transient=True):
        try:
            scene = Scene.write(name, folder / name, seed)
        except UserError as error:
            click.echo(f"left out: {error}", err=True)
            continue
        measured[name] = [scene.error(options) for options in COMMANDS.values()]
    return measured


if __name__ == "__main__":
    main()
