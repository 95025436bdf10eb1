"""Networks as published, and narrow ones of the same form."""

import torch
from torch import nn

from pcsr import Widths
from pcsr.network.network import Network
from pcsr_plugins.backbones.dense_edge_conv import DenseEdgeConvs
from pcsr_plugins.backbones.grad_pu import GradPU
from pcsr_plugins.backbones.pu_gcn import PUGCN
from pcsr_plugins.backbones.pu_net import PUNet
from pcsr_plugins.encoders.edge_conv import EdgeConv
from pcsr_plugins.encoders.linear import Linear
from pcsr_plugins.encoders.mlp import Mlp
from pcsr_plugins.encoders.set_abstraction import BallEncoder
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.upsamplers.branches import Branches
from pcsr_plugins.upsamplers.descent import STEP, Descent
from pcsr_plugins.upsamplers.dis_pu import DisPU
from pcsr_plugins.upsamplers.node_shuffle import NodeShuffle
from pcsr_plugins.upsamplers.progressive import Progressive
from pcsr_plugins.upsamplers.up_down_up import UpDownUp


def pu_net(rate: int = 4) -> Network:
    encoder = BallEncoder(Widths(rate=rate))
    backbone = PUNet(Widths(visual=encoder.channels, rate=rate))
    upsampler = Branches(Widths(visual=encoder.channels, refined=backbone.channels, rate=rate))
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


def mpu(rate: int = 4, neighbours: int = 16, **progressive) -> Network:
    """3PU's, whose levels are one network each."""
    widths = Widths(visual=24, rate=rate)
    backbone = DenseEdgeConvs(widths, growth=12, between=24, neighbours=neighbours)
    refined = Widths(visual=24, refined=backbone.channels, rate=rate)
    upsampler = Progressive(refined, neighbours=neighbours, **progressive)
    return Network(Linear(widths), None, NoFusion(widths), backbone, upsampler)


def pu_gan(rate: int = 4, neighbours: int = 16, **options) -> Network:
    widths = Widths(visual=24, rate=rate)
    backbone = DenseEdgeConvs(widths, neighbours=neighbours)
    upsampler = UpDownUp(Widths(visual=24, refined=backbone.channels, rate=rate), **options)
    return Network(Linear(widths), None, NoFusion(widths), backbone, upsampler)


def awake(module: nn.Module) -> nn.Module:
    """With the γ of PU-GAN's attention away from 0, where it starts and where no gradient gets past it."""
    with torch.no_grad():
        for name, weight in module.named_parameters():
            if name.endswith("gamma"):
                weight.fill_(0.7)
    return module


def dis_pu(neighbours: int = 16) -> Network:
    widths = Widths(visual=24, rate=4)
    backbone = DenseEdgeConvs(widths, neighbours=neighbours)
    upsampler = DisPU(Widths(visual=24, refined=backbone.channels, rate=4))
    return Network(Linear(widths), None, NoFusion(widths), backbone, upsampler)


def pu_gcn(rate: int = 4) -> Network:
    encoder = EdgeConv(Widths(rate=rate))
    backbone = PUGCN(Widths(visual=encoder.channels, rate=rate))
    upsampler = NodeShuffle(Widths(visual=encoder.channels, refined=backbone.channels, rate=rate))
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


def small_pu_gcn(rate: int = 4) -> Network:
    encoder = EdgeConv(Widths(rate=rate), channels=8, neighbours=5)
    backbone = PUGCN(Widths(visual=8, rate=rate), growth=6, neighbours=4)
    upsampler = NodeShuffle(Widths(refined=backbone.channels, rate=rate), channels=8, hidden=8, neighbours=5)
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


def grad_pu() -> Network:
    return _grad_pu(Mlp(Widths(), channels=32, norm="batch"), hidden=(64, 32, 16))


def small_grad_pu(**options) -> Network:
    encoder = Mlp(Widths(), channels=6, norm="batch")
    return _grad_pu(encoder, width=5, growth=4, bottleneck=3, neighbours=4, **options)


def _grad_pu(encoder: Mlp, hidden=(8, 4), step=STEP, **options) -> Network:
    backbone = GradPU(Widths(visual=encoder.channels), **options)
    upsampler = Descent(Widths(refined=backbone.channels), hidden=hidden, step=step)
    return Network(encoder, None, NoFusion(Widths()), backbone, upsampler)


def lively(network: nn.Module) -> nn.Module:
    """Statistics and weights of the norms as training leaves them, so that each of them matters; distances above 0."""
    for module in network.modules():
        if isinstance(module, nn.modules.batchnorm._BatchNorm):
            nn.init.normal_(module.running_mean, std=0.3)
            nn.init.uniform_(module.running_var, 0.5, 2)
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.normal_(module.bias, std=0.3)
    return network


def far(network: Network) -> Network:
    """A Grad-PU whose distances are all above 0, and none too far: every place moves."""
    nn.init.constant_(lively(network).upsampler.layers[-1].bias, 5.0)
    network.upsampler.farthest = 1e3
    return network.eval()
