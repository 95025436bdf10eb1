"""TAPSR's network, 512 points and 4 touches to 8192 points: inference, and a training step of 8 objects.

make bench ARGS=benchmarks/test_network.py

Usual is the plain reading of the papers with the same weights, tests/plugins/plain.py: every edge MLP makes its
(b n k 2c) edges, every head its n × n logits. The limit is as much arithmetic as our layers and our attention need,
done as products of large matrices.
"""

import pytest
import torch
from torch.nn import functional as F
from torch.utils.flop_counter import FlopCounterMode

import pcsr
from pcsr import TouchBatch
from pcsr.metrics import chamfer
from pcsr_plugins.backbones.pu_transformer import ShiftedChannelAttention
from tests.plugins.plain import plain

INFERENCE, INFERENCE_ASKED = "network 512 → 8192, 4 touches: inference", "≥ 2 × the plain reading"
STEP, STEP_ASKED = "network 512 → 8192, 4 touches: training step, 8 objects", "≥ 3 × the plain reading"
BATCH, RATE, SIDE = 8, 16, 512


@pytest.fixture
def network():
    return pcsr.load("tapsr").network


@pytest.fixture
def clouds():
    """Eight dented spheres: sparse clouds, four touches each, truths."""
    generator = torch.Generator().manual_seed(0)
    truth = F.normalize(torch.randn(BATCH, 8192, 3, generator=generator), dim=-1)
    truth = truth * (0.8 + 0.2 * torch.sin(5 * truth[..., :1]))
    near = torch.cdist(truth[:, :4], truth).topk(512, largest=False).indices
    return truth[:, ::RATE].contiguous(), truth[torch.arange(BATCH)[:, None, None], near], truth


def inference(network, clouds, precision=torch.float32):
    points, touches, _ = (cloud[:1] for cloud in clouds)

    @torch.inference_mode()
    def run():
        with torch.autocast("cpu", torch.bfloat16, enabled=precision == torch.bfloat16):
            return network(points, RATE, TouchBatch.of(touches))

    return run


def step(network, clouds, precision=torch.float32):
    """Forward, backward and Adam; without the loss, which has lines of its own."""
    points, touches, truth = clouds
    optimizer = torch.optim.Adam(network.train().parameters(), lr=1e-6)

    def run():
        with torch.autocast("cpu", torch.bfloat16, enabled=precision == torch.bfloat16):
            dense = network(points, RATE, TouchBatch.of(touches))
        optimizer.zero_grad()
        (dense.float() * truth).mean().backward()
        optimizer.step()

    return run


def arithmetic(network, run):
    """A function that does as many operations as `run`, in products of matrices."""
    operations = []

    def attention(layer, _, output):
        """Of which torch's counter knows nothing: QKᵀ and AV, and twice as much on the way back."""
        b, n, _ = output.shape
        operations.append(4 * b * n * n * layer.out.in_features * (3 if torch.is_grad_enabled() else 1))

    handles = [m.register_forward_hook(attention) for m in network.modules() if isinstance(m, ShiftedChannelAttention)]
    with FlopCounterMode(display=False) as counter:
        run()
    for handle in handles:
        handle.remove()
    a, b, c = torch.randn(3, SIDE, SIDE)
    times = round((counter.get_total_flops() + sum(operations)) / (2 * SIDE**3))

    def limit():
        for _ in range(times):
            torch.mm(a, b, out=c)

    return limit, f"limit: {2 * SIDE**3 * times / 1e9:.1f} GFLOP"


def test_inference(benchmark, line, network, clouds):
    line(INFERENCE, "ours", INFERENCE_ASKED)
    benchmark(inference(network, clouds))


def test_inference_plain(benchmark, line, network, clouds):
    line(INFERENCE, "usual")
    benchmark(inference(plain(network), clouds))


def test_inference_limit(benchmark, line, network, clouds):
    limit, says = arithmetic(network, inference(network, clouds))
    line(INFERENCE, "limit", says=says)
    benchmark(limit)


def test_step(benchmark, line, network, clouds):
    line(STEP, "ours", STEP_ASKED)
    benchmark.pedantic(step(network, clouds), rounds=5, warmup_rounds=1)


def test_step_plain(benchmark, line, network, clouds):
    line(STEP, "usual")
    benchmark.pedantic(step(plain(network), clouds), rounds=3, warmup_rounds=1)


def test_step_limit(benchmark, line, network, clouds):
    limit, says = arithmetic(network, step(network, clouds))
    line(STEP, "limit", says=says)
    benchmark.pedantic(limit, rounds=5, warmup_rounds=1)


@pytest.mark.parametrize(("what", "work"), [(INFERENCE, inference), (STEP, step)], ids=["inference", "step"])
def test_bf16(benchmark, line, network, clouds, what, work):
    """`train.precision: bf16-mixed`; the usual way is single precision."""
    line(f"{what}, in bf16", "ours", "on where it pays and CD moves < 1 %")
    errors = [
        float(chamfer(inference(network, clouds, precision)().float(), clouds[2][:1]))
        for precision in (torch.float32, torch.bfloat16)
    ]
    benchmark.extra_info["says"] = f"CD {100 * (errors[1] / errors[0] - 1):+.2f} %"
    benchmark.pedantic(work(network, clouds, torch.bfloat16), rounds=5, warmup_rounds=1)


@pytest.mark.parametrize(("what", "work"), [(INFERENCE, inference), (STEP, step)], ids=["inference", "step"])
def test_single_precision(benchmark, line, network, clouds, what, work):
    line(f"{what}, in bf16", "usual")
    benchmark.pedantic(work(network, clouds), rounds=5, warmup_rounds=1)
