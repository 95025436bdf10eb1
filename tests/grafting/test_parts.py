import pytest
import torch
from torch import nn

from pcsr.contracts import Widths
from pcsr.errors import UserError
from pcsr.grafting import graft
from pcsr.grafting.parts import build_part
from pcsr_plugins.encoders.mlp import Mlp
from pcsr_plugins.fusions.concat import Concat
from tests.grafting.networks import PLUGINS, Bias, Meeting


def test_parts_are_taken_by_name_by_options_and_as_they_are(world):
    points, touches = world
    network = Meeting(None)
    encoder = Mlp(Widths(), channels=6)
    for fusion, touch_encoder in [
        ("iterative", "mlp"),
        ({"use": "iterative", "pool": "global"}, {"use": "unet", "channels": 4}),
        (Concat(Widths(visual=8, touch=6)), encoder),
        ("concat", None),
    ]:
        grafted = graft(network, "layer", fusion=fusion, touch_encoder=touch_encoder, registry=PLUGINS)
        assert not torch.equal(grafted(points, touches=touches), network(points))
    assert graft(network, "layer", touch_encoder=encoder, registry=PLUGINS).touch_encoder is encoder


@pytest.mark.parametrize(("width", "channels"), [(8, 8), (32, 8), (128, 32), (150, 38)])
def test_the_default_touch_encoder_is_a_unet_of_a_quarter_of_the_width(width, channels):
    network = nn.Sequential(nn.Linear(3, width), nn.Linear(width, 3))
    spec = graft(network, "0", registry=PLUGINS).specs["touch_encoder"]
    plain = {"norm": "none", "negative_slope": 0.0}
    assert spec == {"use": "unet", "channels": channels, "order": "hilbert", **plain}


class JoinsToo(Bias):
    def join(self, points, touches):
        return points


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fusion": "iterativ"}, r"there is no fusion 'iterativ': did you mean 'iterative'\?"),
        ({"fusion": {"use": "iterative", "pol": "none"}}, r"fusion 'iterative' takes no 'pol': did you mean 'pool'\?"),
        ({"fusion": {"use": "iterative", "pool": "max"}}, r"fusion 'iterative'\.pool: it must be .*got 'max'"),
        ({"fusion": {"use": "concat", "touches": "two"}}, r"fusion 'concat'\.touches: it must be a whole number"),
        ({"fusion": {"pool": "none"}}, r"fusion \{'pool': 'none'\}: give a name"),
        ({"touch_encoder": {"use": "unet", "channels": {1}}}, "encoder 'unet': JSON cannot represent its options"),
        ({"touch_encoder": {"use": "unet", "channels": -8}}, "encoder 'unet'.channels: it must be 2 or more, got -8"),
        ({"fusion": "none"}, "fusion 'none' joins touched points.*does not know which outputs"),
        ({"fusion": JoinsToo(Widths())}, "fusion 'JoinsToo' joins touched points"),
        (
            {"fusion": Concat(Widths(visual=9, touch=8))},
            "Concat does not fit layer 'layer' of 8 channels.*RuntimeError",
        ),
        ({"fusion": Bias(Widths(), 2)}, "Bias does not fit layer 'layer' of 8 channels"),
        ({"layout": "bnd"}, r"layout='bnd' is unknown: did you mean 'bnc'\?"),
        ({"points_layout": "bcn1"}, r"points_layout='bcn1' is unknown: did you mean 'bcn'\?"),
    ],
)
def test_a_mistake_in_the_parts_is_one_line(options, message):
    with pytest.raises(UserError, match=message) as caught:
        graft(Meeting(None), "layer", **({"registry": PLUGINS} | options))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        ("fusion", None, "fusion None: give a name, .* or a pcsr.Fusion"),
        ("fusion", Mlp(Widths()), r"(?s)fusion Mlp.*: give a name"),
        ("encoder", 32, "encoder 32: give a name, .* or a pcsr.Encoder"),
    ],
)
def test_what_is_no_part_at_all_is_refused(kind, given, message):
    with pytest.raises(UserError, match=message) as caught:
        build_part(kind, given, Widths(), PLUGINS)
    assert "\n" not in str(caught.value)
