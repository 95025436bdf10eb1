"""A linear layer, a batch norm and ReLU: the layer of Grad-PU, channels last.

A batch norm ties the points of one object to those of the others while it is trained, which is why the networks of this
project have none by themselves. It is here for weights that were published with one; in `eval` mode it ties nothing.
"""

from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

Rows = Float[Tensor, "*points c"]


class PointNorm(nn.BatchNorm1d):
    """A batch norm over everything but the channels, which come last; its weights are those of any batch norm."""

    def forward(self, input: Rows) -> Rows:  # noqa: A002
        """Normalise each channel over all points, or all edges, of the batch."""
        return super().forward(input.reshape(-1, self.num_features)).view(input.shape)


class LinearNormReLU(nn.Module):
    """The three in a row. The input may have any axes before its channels."""

    def __init__(self, c_in: int, c_out: int) -> None:
        super().__init__()
        self.linear = nn.Linear(c_in, c_out)
        self.norm = PointNorm(c_out)

    def forward(self, features: Rows) -> Float[Tensor, "*points c2"]:
        """Linear layer, norm, activation; in `eval` mode the norm is but a factor and goes into the linear layer."""
        linear, norm = self.linear, self.norm
        if self.training or norm.running_mean is None or norm.running_var is None:
            return self.normalised(linear(features))
        factor = norm.weight * (norm.running_var + norm.eps).rsqrt()
        bias = norm.bias + factor * (linear.bias - norm.running_mean)
        return F.relu(F.linear(features, factor.unsqueeze(1) * linear.weight, bias))

    def normalised(self, features: Rows) -> Rows:
        """Norm and activation alone."""
        return F.relu(self.norm(features))
