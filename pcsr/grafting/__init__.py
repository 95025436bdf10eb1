"""Touch for a foreign network: the output of one of its layers is fused with touch features."""

from pcsr.grafting.assembly import graft
from pcsr.grafting.files import load_graft, save_graft
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.injection_point import InjectionPoint

__all__ = ["Grafted", "InjectionPoint", "graft", "load_graft", "save_graft"]
