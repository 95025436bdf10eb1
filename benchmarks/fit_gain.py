"""Coefficients of `pcsr.exploration.gain`, fitted on training parts.

python benchmarks/fit_gain.py [--parts 16] [--candidates 24]

Each training part of 30 mm is touched once at each of several random candidates, and its cloud of 512 random points is
upsampled by `field` with that touch. The gains are fitted by least squares with coefficients from 0 on, as shares of
the part's error; of the candidates those with the greater half of squared distances, since these are chosen. The error
without touch is fitted likewise, over parts.
"""

from dataclasses import dataclass

import click
import numpy as np
from expected_gain import SIZE, distance
from jaxtyping import Float
from scipy.optimize import nnls

import pcsr
from pcsr import TouchCandidates
from pcsr.data.sample import make_sample
from pcsr.exploration import Expectation
from pcsr.exploration.gain import NEIGHBOURS, Density
from pcsr.geometry.rays import MeshRays
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Data, PartSpec
from pcsr.upsample.protocol import upsample_as
from pcsr_plugins.touch.digit import Digit
from pcsr_plugins.touch.digit.candidates import Candidates

TRIES = 300
"""Random candidates of a part, of which the first ones that can be reached are touched."""


@dataclass(frozen=True)
class Rows:
    """Terms and values of one part, as shares of its error."""

    terms: Float[np.ndarray, "c 2"]
    gains: Float[np.ndarray, " c"]
    error_terms: Float[np.ndarray, "2"]


def rows_of(name: str, count: int, model: pcsr.Model) -> Rows:
    """Touch a part at `count` candidates, and measure what each touch takes off the error."""
    item = load_plugins().get("shapes", "cad-parts")(held_out=24).item(name)
    sample = make_sample(item, Digit(), Data(shapes=PartSpec(use="cad-parts"), touch=PartSpec(use="digit")), 0, 0)
    hand = Digit(object_size=SIZE).hand
    rays = MeshRays(item.mesh, SIZE, name)
    rng = np.random.default_rng(7)
    (drawn,) = Candidates.draw(rays, TRIES, hand.tilt, hand.press, [rng])
    assert model.network is not None
    assert model.recipe is not None
    plain = distance(upsample_as(model.recipe, model.network, sample.points), sample.truth)
    radius = sample.sphere.radius * rays.unit
    cloud = radius * sample.points.astype(np.float64)
    points = (drawn.points / rays.unit + rays.to_object[:3, 3] - sample.sphere.centre) * rays.unit
    expectation = Expectation.of(points[drawn.open], cloud, np.zeros((0, 3)))
    terms, gains = [], []
    for row in np.flatnonzero(drawn.open):
        contact = hand.finger.press(rays, drawn.points[row], drawn.frames[row], float(drawn.presses[row]))
        if contact is None or contact.pixels < hand.at_least:
            continue
        one = TouchCandidates(points[[row]], drawn.frames[[row]], drawn.presses[[row]], hand.fingertip)
        (found,) = expectation.contacts(one)
        if found is None:
            continue
        local = contact.points(contact.seen[..., 2])
        touched = local @ contact.pose[:3, :3].T + contact.pose[:3, 3]
        touched = sample.sphere.normalize(rng.permutation(touched / rays.unit + rays.to_object[:3, 3])[:512])
        dense = upsample_as(model.recipe, model.network, sample.points, [touched])
        gains.append(1 - distance(dense, sample.truth) / plain)
        terms.append(_terms(expectation, found.points) @ found.probability * found.cell / expectation.area)
        if len(gains) == count:
            break
    scale = plain * radius**2
    return Rows(np.array(terms) / scale, np.array(gains), _terms(expectation, expectation.surface).mean(1) / scale)


def _terms(expectation: Expectation, points: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "2 p"]:
    """The squared distances, and their products with the variation of normals."""
    squared = Density.at(points, expectation.known, smooth=1.0, curved=0.0).seen()
    variation = expectation.known.variation[expectation.known.thinned.query(points, k=NEIGHBOURS)[1]].mean(1)
    return np.stack([squared, squared * variation])


@click.command()
@click.option("--parts", default=16, show_default=True)
@click.option("--candidates", default=24, show_default=True)
def main(parts: int, candidates: int) -> None:
    """Print the coefficients."""
    names = load_plugins().get("shapes", "cad-parts")(held_out=24).names("train")[:parts]
    model = pcsr.load("field")
    found = []
    for name in names:
        found.append(rows_of(name, candidates, model))
        click.echo(f"{name}: gains of {found[-1].gains.mean():.1%} in the mean", err=True)
    upper = [rows.terms[:, 0] >= np.median(rows.terms[:, 0]) for rows in found]
    terms = np.concatenate([rows.terms[kept] for rows, kept in zip(found, upper, strict=True)])
    gains = np.concatenate([rows.gains[kept] for rows, kept in zip(found, upper, strict=True)])
    smooth, curved = nnls(terms, gains)[0]
    click.echo(f"SMOOTH, CURVED = {smooth:.3f}, {curved:.3f}")
    smooth, curved = nnls(np.array([rows.error_terms for rows in found]), np.ones(len(found)))[0]
    click.echo(f"ERROR_SMOOTH, ERROR_CURVED = {smooth:.3f}, {curved:.3f}")


if __name__ == "__main__":
    main()
