import copy
import json

import pytest
import torch
from safetensors.torch import load_file, save_file
from torch import nn

from pcsr.contracts import Widths
from pcsr.errors import UserError
from pcsr.grafting import graft, load_graft, save_graft
from pcsr.weights.file import read_card
from tests.grafting.networks import PLUGINS, Bias, Meeting, same


@torch.no_grad()
def test_a_saved_graft_comes_back_on_a_fresh_network(case, world, tmp_path):
    points, touches = world
    grafted = case.graft(fusion={"use": "concat", "touches": 3}, touch_encoder={"use": "mlp", "channels": 5})
    save_graft(tmp_path / "graft.safetensors", grafted, {"epoch": 3})
    loaded = load_graft(tmp_path / "graft.safetensors", case.make(seed=1), PLUGINS)
    for touch in ({}, {"touches": touches}):
        assert torch.equal(case.call(loaded, points, **touch), case.call(grafted, points, **touch))
    assert (loaded.injection_point, loaded.specs, loaded.training) == (grafted.injection_point, grafted.specs, False)
    assert read_card(tmp_path / "graft.safetensors")["about"] == {"epoch": 3}
    assert [path.name for path in tmp_path.iterdir()] == ["graft.safetensors"]


def test_another_network_is_refused_by_its_weights_and_nothing_changes(tmp_path):
    path = tmp_path / "graft.safetensors"
    save_graft(path, graft(nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 3)), "0", registry=PLUGINS))
    wider = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 5))
    before = copy.deepcopy(wider.state_dict())
    with pytest.raises(
        UserError, match=r"network\.1\.weight is \(3, 8\) in the file, \(5, 8\) in the network"
    ) as caught:
        load_graft(path, wider, PLUGINS)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert same(before.values(), wider.state_dict().values())
    with pytest.raises(UserError, match=r"the network has no network\.1\.bias; the network has no network\.1\.weight"):
        load_graft(path, nn.Sequential(nn.Linear(3, 8)), PLUGINS)
    more = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 3), nn.Linear(3, 3), nn.Linear(3, 3))
    with pytest.raises(UserError, match=r"the file has no network\.2\.weight; .*network\.3\.weight and 1 more\."):
        load_graft(path, more, PLUGINS)
    with pytest.raises(UserError, match="Meeting has no layer '0': it has layer, head"):
        load_graft(path, Meeting(None), PLUGINS)


def test_weights_that_layers_share_are_saved(tmp_path, world):
    points, touches = world
    network = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 8), nn.Linear(8, 8))
    network[2].weight = network[1].weight
    grafted = graft(network, "0", registry=PLUGINS).eval()
    save_graft(tmp_path / "graft", grafted)
    other = copy.deepcopy(network)
    with torch.no_grad():
        other[1].weight.zero_()
    loaded = load_graft(tmp_path / "graft", other, PLUGINS)
    assert torch.equal(loaded(points, touches=touches), grafted(points, touches=touches))


def test_what_a_header_cannot_say_is_not_saved(tmp_path):
    grafted = graft(Meeting(None), "layer", fusion=Bias(Widths()), registry=PLUGINS)
    with pytest.raises(UserError, match="the fusion of this graft was given as an instance"):
        save_graft(tmp_path / "graft", grafted)
    grafted = graft(Meeting(None), "layer", registry=PLUGINS)
    for about, named in (({"device": torch.device("cpu")}, "'device'"), ({"loss": float("nan")}, "'loss': nan")):
        with pytest.raises(UserError, match=rf"about=\{{{named}.*\}}, options=None: the header of a graft is what"):
            save_graft(tmp_path / "graft", grafted, about)
    for touches in ((-1, 8), (17, 8), (2, 0)):
        with pytest.raises(UserError, match=rf"touches=\({touches[0]}, {touches[1]}\): give the largest number"):
            save_graft(tmp_path / "graft", grafted, touches=touches)
    assert not list(tmp_path.iterdir())


def test_files_of_others_are_refused(tmp_path):
    path = tmp_path / "graft"
    with pytest.raises(UserError, match="there is no such file"):
        load_graft(path, Meeting(None), PLUGINS)
    injection_point = {"at": "layer", "layout": "bnc", "width": 8}
    cards = [
        {"recipe": {}},
        [],
        {"graft": []},
        {"graft": {"injection_point": injection_point}},
        {"graft": {"injection_point": injection_point | {"depth": 1}}},
    ]
    for metadata in (None, {"pcsr": "{"}, *({"pcsr": json.dumps(card)} for card in cards)):
        save_file({"weight": torch.zeros(2)}, path, metadata)
        with pytest.raises(UserError, match="is not a file of save_graft"):
            load_graft(path, Meeting(None), PLUGINS)
    path.write_bytes(b"hello" * 100)
    with pytest.raises(UserError, match="is not a file of save_graft"):
        load_graft(path, Meeting(None), PLUGINS)


@pytest.mark.parametrize(
    "card",
    [
        [],
        7,
        {"graft": 7},
        {"graft": {"injection_point": [], "fusion": 1, "touch_encoder": 1}},
        {"graft": {"injection_point": {"at": 5, "layout": "bnc", "width": 8}, "fusion": {}, "touch_encoder": {}}},
        {"graft": {"injection_point": {"at": "0", "layout": [], "width": 8}, "fusion": {}, "touch_encoder": {}}},
        {
            "graft": {
                "injection_point": {"at": "0", "layout": "bnc", "width": 10**12},
                "fusion": {},
                "touch_encoder": {},
            }
        },
        {"graft": {"injection_point": {"at": "0", "layout": "bnc", "width": 8, "k" * 5000: 1}}},
    ],
)
def test_headers_that_describe_no_graft_are_refused(tmp_path, card):
    path = tmp_path / "graft.safetensors"
    save_file({"a": torch.zeros(1)}, path, {"pcsr": json.dumps(card)})
    with pytest.raises(UserError, match="is not a file of save_graft") as caught:
        load_graft(path, nn.Sequential(nn.Linear(3, 8)), PLUGINS)
    assert len(str(caught.value)) < 500


@torch.no_grad()
def test_files_of_0_1_are_read(tmp_path, world):
    points, touches = world
    path = tmp_path / "graft.safetensors"
    grafted = graft(Meeting(None), "layer", registry=PLUGINS).eval()
    save_graft(path, grafted)
    card = read_card(path)
    card["graft"]["joint"] = card["graft"].pop("injection_point")
    save_file(load_file(path), path, {"pcsr": json.dumps(card)})
    loaded = load_graft(path, Meeting(None), PLUGINS)
    assert loaded.injection_point == grafted.injection_point
    assert torch.equal(loaded(points, touches=touches), grafted(points, touches=touches))
