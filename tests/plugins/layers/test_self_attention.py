"""Self-attention (PU-GAN, Sec. 3.2.3) against the softmax of all products."""

import torch
from torch.nn import functional as F
from torch.nn.attention import SDPBackend, sdpa_kernel

from pcsr_plugins.layers.self_attention import SelfAttention
from tests.plugins.compare import same_gradients
from tests.plugins.published import awake


def test_self_attention_is_the_softmax_of_all_products_forward_and_backward():
    layer, x = awake(SelfAttention(18)).double(), torch.randn(2, 11, 18, dtype=torch.float64, requires_grad=True)
    q, k, v = (F.relu(part(x)) for part in (layer.query, layer.key, layer.value))
    assert q.shape[-1] == k.shape[-1] == 4
    slow = x + layer.gamma * torch.softmax(q @ k.transpose(1, 2), dim=-1) @ v
    fast = layer(x)
    torch.testing.assert_close(fast, slow)
    same_gradients(fast, slow, (x, *layer.parameters()))


def test_self_attention_starts_as_nothing():
    x = torch.randn(1, 9, 8)
    assert torch.equal(SelfAttention(8)(x), x)


def test_self_attention_never_holds_all_products():
    """The fused kernel takes it as it is, there and back; asked for alone, it is refused where it can't."""
    x = torch.randn(2, 40, 130, requires_grad=True)
    with sdpa_kernel(SDPBackend.FLASH_ATTENTION):
        awake(SelfAttention(130))(x).sum().backward()
    assert x.grad.abs().max() > 0
