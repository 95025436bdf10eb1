"""The kinds of networks that a recipe describes."""

from pcsr.grafting.grafted_network import GraftedNetwork
from pcsr.network.network import Network

AnyNetwork = Network | GraftedNetwork
"""A network of parts, or a graft on a foreign network. Both are called and measured alike."""
