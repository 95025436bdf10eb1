"""`grad-pu`: point convolutions in dense blocks."""

import pytest
import torch

from tests.plugins.compare import close
from tests.plugins.published import lively, small_grad_pu


@pytest.mark.parametrize("training", [False, True])
@torch.no_grad()
def test_backbone_follows_a_permutation(training):
    network, points, shuffled = lively(small_grad_pu()).train(training), torch.randn(2, 20, 3), torch.randperm(20)
    close(network.refine(points[:, shuffled])[1], network.refine(points)[1][:, shuffled], 1e-4)


@torch.no_grad()
def test_where_a_cloud_is_does_not_matter_to_the_convolutions_but_to_the_encoder():
    network, points, features = lively(small_grad_pu()).eval(), torch.randn(1, 20, 3), torch.randn(1, 20, 6)
    close(network.backbone(points + 1, features), network.backbone(points, features), 1e-4)
    assert (network.refine(points + 1)[1] - network.refine(points)[1]).abs().max() > 1e-2
