"""PU-GCN's graph and its edge convolution.

Qian et al., "PU-GCN: Point Cloud Upsampling using Graph Convolutional Networks", CVPR 2021, in the reading of
its published code: of the edge from i to j the centre xᵢ and the difference xⱼ − xᵢ have weights of their own, and
only the latter a bias.
"""

from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from pcsr.geometry.neighbours import knn, neighbour_max
from pcsr.tensors import Features, Neighbours


def graph(x: Float[Tensor, "b n d"], neighbours: int) -> Neighbours:
    """The nearest other points of each point, nearest first, in whatever space `x` is.

    Raises:
        UserError: there are no more points than neighbours.
    """
    return knn(x, x, neighbours + 1)[..., 1:]


class EdgeConv(nn.Module):
    """max over j of ReLU(W₁·(xⱼ − xᵢ) + b + W₂·xᵢ).

    ReLU grows and only W₁·xⱼ depends on j: it is ReLU((W₂ − W₁)·xᵢ + b + max over j of W₁·xⱼ), and the edges are
    never stored.
    """

    def __init__(self, c_in: int, c_out: int) -> None:
        super().__init__()
        self.message = nn.Linear(c_in, c_out)
        self.centre = nn.Linear(c_in, c_out, bias=False)

    def forward(self, x: Features, index: Neighbours) -> Float[Tensor, "b n wide"]:
        """Features of the edges' maximum."""
        return F.relu(self.at_centre(x) + neighbour_max(self.at_neighbour(x), index))

    def at_centre(self, x: Features) -> Float[Tensor, "b n wide"]:
        """Term of an edge that depends on its own point: (W₂ − W₁)·xᵢ + b."""
        return F.linear(x, self.centre.weight - self.message.weight, self.message.bias)

    def at_neighbour(self, x: Features) -> Float[Tensor, "b n wide"]:
        """Term of an edge that depends on the other point: W₁·xⱼ."""
        return F.linear(x, self.message.weight)
