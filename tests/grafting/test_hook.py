"""The hook of a graft is there while the network is called with touches, and for that call alone."""

import threading

import pytest
import torch

from pcsr.grafting import graft, load_graft, save_graft
from tests.grafting.networks import CASES, PLUGINS, Meeting, same


@torch.no_grad()
def test_without_touches_there_is_no_hook(world):
    """Some of torch's layers compute otherwise where a hook is: then nothing would be bit for bit the same."""
    points, touches = world

    class Watched(Meeting):
        def forward(self, points):
            hooks.append(len(self.layer._forward_hooks))
            return super().forward(points)

    hooks = []
    grafted = graft(Watched(None), "layer", registry=PLUGINS)
    hooks.clear()
    none = torch.zeros(3, 2, dtype=torch.bool)
    for touch in ({}, {"touches": touches[:, :0]}, {"touches": touches, "mask": none}, {"touches": touches}):
        grafted(points, **touch)
    assert hooks == [0, 0, 0, 1]


@torch.no_grad()
def test_the_touches_do_not_outlive_a_forward_that_fails(world, monkeypatch):
    points, touches = world
    case = CASES["pu-net"]
    grafted = case.graft()
    alone = case.call(grafted, points)
    with pytest.raises(IndexError):
        grafted(points.transpose(1, 2), 9, touches=touches)  # it knows four at most, and notices behind the layer
    assert not grafted.network.mlp2._forward_hooks
    assert torch.equal(case.call(grafted, points), alone)
    assert torch.equal(case.call(grafted.network, points), alone)


def test_threads_do_not_hear_each_others_touches(world):
    points, touches = world
    grafted = graft(Meeting(None), "layer", registry=PLUGINS).requires_grad_(False)
    # A shallow copy, as nn.DataParallel makes them: its own module, the same dictionary of hooks.
    replica = grafted._replicate_for_data_parallel()
    replica.network = grafted.network._replicate_for_data_parallel()
    for module in (replica, replica.network):
        module._modules = dict(module._modules)
    replica.network.layer = grafted.network.layer._replicate_for_data_parallel()
    replica.network.layer.weight, replica.network.layer.bias = grafted.network.layer.weight, grafted.network.layer.bias
    assert replica.network.layer._forward_hooks is grafted.network.layer._forward_hooks
    calls = [(grafted, touches), (replica, -touches), (grafted, touches[:, :1]), (grafted, None)]
    expected = [grafted(points, touches=touch) for _, touch in calls]
    grafted.network.barrier = replica.network.barrier = threading.Barrier(len(calls))
    results = [None] * len(calls)

    def work(index):
        results[index] = calls[index][0](points, touches=calls[index][1])

    threads = [threading.Thread(target=work, args=(index,)) for index in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    for result, wanted in zip(results, expected, strict=True):
        torch.testing.assert_close(result, wanted, atol=1e-6, rtol=0)
    assert not torch.equal(expected[0], expected[1])


@torch.no_grad()
def test_two_grafts_share_a_network_without_hearing_each_other(world):
    points, touches = world
    network = Meeting(None)
    first, second = graft(network, "layer", registry=PLUGINS), graft(network, "head", registry=PLUGINS)
    before = first(points, touches=touches), second(points, touches=touches)
    assert same(before, (first(points, touches=touches), second(points, touches=touches)))
    assert not torch.equal(*before)


@torch.no_grad()
def test_a_graft_on_a_graft_hears_touch_at_both_layers(world, tmp_path):
    points, touches = world
    inner = graft(Meeting(None), "layer", registry=PLUGINS)
    outer = graft(inner, "network.head", fusion="concat", registry=PLUGINS)
    fused = []
    for part in (inner.fusion, outer.fusion):
        part.register_forward_hook(lambda part, args, output: fused.append(type(part).__name__))
    both = outer(points, touches=touches)
    assert fused == ["Iterative", "Concat"]
    assert torch.equal(outer(points), inner.network(points))
    assert len(list(outer.tactile_parameters())) == len(list(outer.parameters())) - 4
    save_graft(tmp_path / "two", outer)
    loaded = load_graft(tmp_path / "two", graft(Meeting(None), "layer", registry=PLUGINS), PLUGINS)
    assert torch.equal(loaded(points, touches=touches), both)
