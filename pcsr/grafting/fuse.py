"""Encoding of touches and their fusion with the features of a layer, in networks of the toolkit and in grafted ones."""

import torch
from torch import Tensor

from pcsr.contracts import Encoder, Fusion, TouchBatch
from pcsr.tensors import Features, Points


def fuse(
    fusion: Fusion, touch_encoder: Encoder | None, points: Points, features: Features, touches: TouchBatch
) -> Features:
    """Encode the touches and fuse them with the features. Rows without touches keep their features.

    The fusion sees only rows with at least one touch, since attention over none would divide zero by zero. Zero
    touches thus give exactly the visual features.
    """
    touched = touches.mask.any(1)
    if not torch.compiler.is_exporting():
        if not touched.any():
            return features
        if not touched.all():
            some = TouchBatch.of(touches.points[touched], touches.mask[touched])
            fused = fuse(fusion, touch_encoder, points[touched], features[touched], some)
            return features.masked_scatter(touched[:, None, None], fused)
    result: Features = fusion(points, features, encode(touch_encoder, touches))
    return result


def encode(touch_encoder: Encoder | None, touches: TouchBatch) -> TouchBatch:
    """Compute the features of the touched points; without an encoder they are the coordinates."""
    if touch_encoder is None:
        return touches
    features: Tensor = touch_encoder(touches.points.flatten(0, 1))
    return TouchBatch(touches.points, features.view(*touches.points.shape[:2], *features.shape[1:]), touches.mask)
