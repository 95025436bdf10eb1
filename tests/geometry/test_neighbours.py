import pytest
import torch

from pcsr import UserError
from pcsr.geometry.neighbours import gather, knn, neighbour_max


def test_knn_agrees_with_sorting_every_distance():
    query, points = torch.randn(2, 7, 3), torch.randn(2, 30, 3)
    distances = (query[:, :, None] - points[:, None]).square().sum(-1)
    assert torch.equal(knn(query, points, 5), distances.argsort(-1)[..., :5])


def test_a_point_finds_itself_first_far_from_the_origin():
    points = torch.randn(1, 50, 3) * 1e-3 + 100
    assert torch.equal(knn(points, points, 3)[0, :, 0], torch.arange(50))


def test_too_few_points_is_said():
    with pytest.raises(UserError, match="20 neighbours were asked of 7 points"):
        knn(torch.zeros(1, 7, 3), torch.zeros(1, 7, 3), 20)


def test_gather_picks_rows():
    features = torch.arange(24.0).view(2, 4, 3)
    index = torch.tensor([[[0, 3]], [[2, 2]]])
    assert torch.equal(gather(features, index)[0, 0], features[0, [0, 3]])
    assert torch.equal(gather(features, index)[1, 0], features[1, [2, 2]])


def test_neighbour_max_equals_the_plain_maximum_in_value_and_gradient():
    index = torch.randint(0, 20, (2, 11, 6))
    a = torch.randn(2, 20, 5, dtype=torch.float64, requires_grad=True)
    b = a.detach().clone().requires_grad_()
    ours, plain = neighbour_max(a, index), gather(b, index).max(2).values
    weight = torch.randn_like(plain)
    (ours * weight).sum().backward()
    (plain * weight).sum().backward()
    assert torch.equal(ours, plain)
    assert torch.allclose(a.grad, b.grad)
