"""Touch on a network of somebody else's: what one of its layers gives is fused with the touches."""

from pcsr.grafting.assembly import graft
from pcsr.grafting.files import load_graft, save_graft
from pcsr.grafting.grafted import Grafted

__all__ = ["Grafted", "graft", "load_graft", "save_graft"]
