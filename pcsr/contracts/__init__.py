"""The kinds of part, and the records that pass between them. Read this package first.

A network is an encoder, a fusion, a backbone and an upsampler in a row. Touch enters at the fusion, through a touch
encoder (TAPSR, Sec. 3.1, Fig. 1)::

    P (b n 3) ──► encoder ──► Fp ──┐
                                   ├─► fusion ──► Ff ──► backbone ──► F ──► upsampler ──► Q (b r·n 3)
    T (b a m 3) ─► touch encoder ─► Ft ┘

`pcsr.contracts.network` holds the four kinds of network part; `pcsr.contracts.objective` what trains a network;
`pcsr.contracts.sources` the two kinds that build data; `pcsr.contracts.evaluation` metrics and baselines;
`pcsr.contracts.policy` what chooses where to touch next; `pcsr.contracts.logger` what records a training;
`pcsr.contracts.part` what all kinds have in common.
"""

from pcsr.contracts.evaluation import Baseline, Metric
from pcsr.contracts.logger import Logger
from pcsr.contracts.network import Backbone, Encoder, Fusion, Upsampler
from pcsr.contracts.objective import Objective, UpsamplingNetwork
from pcsr.contracts.part import Part, Trait, Widths
from pcsr.contracts.policy import Fingertip, Policy, TouchCandidates
from pcsr.contracts.sources import SPLITS, ShapeItem, ShapeSource, SimulatedFinger, TouchSource
from pcsr.contracts.touch_batch import TouchBatch

__all__ = [
    "SPLITS",
    "Backbone",
    "Baseline",
    "Encoder",
    "Fingertip",
    "Fusion",
    "Logger",
    "Metric",
    "Objective",
    "Part",
    "Policy",
    "ShapeItem",
    "ShapeSource",
    "SimulatedFinger",
    "TouchBatch",
    "TouchCandidates",
    "TouchSource",
    "Trait",
    "Upsampler",
    "UpsamplingNetwork",
    "Widths",
]
