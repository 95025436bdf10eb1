import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pcsr.metrics import hausdorff, hausdorff_pugcn


def clouds(*sizes, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return [torch.randn(2, n, 3, generator=generator, dtype=torch.float64) for n in sizes]


def naive(a, b):
    """Both directed distances, one point at a time."""

    def directed(source, target):
        return max(min((s - t).norm().item() for t in target) for s in source)

    there = [directed(x, y) for x, y in zip(a, b, strict=True)]
    back = [directed(y, x) for x, y in zip(a, b, strict=True)]
    return torch.tensor([there, back], dtype=torch.float64)


@given(st.integers(1, 8), st.integers(1, 8), st.integers(0, 99))
@settings(max_examples=30, deadline=None)
def test_both_conventions_agree_with_their_definitions_and_are_symmetric(p, t, seed):
    a, b = clouds(p, t, seed=seed)
    both = naive(a, b)
    assert torch.allclose(hausdorff(a, b), both.max(0).values)
    assert torch.allclose(hausdorff_pugcn(a, b), both.square().sum(0))
    assert torch.equal(hausdorff(a, b), hausdorff(b, a))
    assert torch.equal(hausdorff_pugcn(a, b), hausdorff_pugcn(b, a))


@given(st.floats(0.01, 100))
@settings(max_examples=20, deadline=None)
def test_one_grows_with_the_scale_and_the_other_with_its_square(scale):
    a, b = clouds(20, 30)
    assert torch.allclose(hausdorff(scale * a, scale * b), scale * hausdorff(a, b))
    assert torch.allclose(hausdorff_pugcn(scale * a, scale * b), scale**2 * hausdorff_pugcn(a, b))


def test_a_cloud_is_at_no_distance_from_itself():
    (a,) = clouds(30)
    assert hausdorff(a, a.flip(1)).tolist() == hausdorff_pugcn(a, a.flip(1)).tolist() == [0, 0]


def test_the_direction_with_the_greater_distance_counts_in_one_and_both_in_the_other():
    a, b = torch.tensor([[[0.0, 0, 0], [0, 0, 4]]]), torch.tensor([[[0.0, 0, 1]]])
    assert hausdorff(a, b).item() == 3
    assert hausdorff_pugcn(a, b).item() == 9 + 1
