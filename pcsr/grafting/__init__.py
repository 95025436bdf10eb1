"""Touch on a network of somebody else's: what one of its layers gives is fused with the touches."""

from pcsr.grafting.assembly import graft
from pcsr.grafting.files import load_graft, save_graft
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.injection_point import InjectionPoint

__all__ = ["Grafted", "InjectionPoint", "graft", "load_graft", "save_graft"]
