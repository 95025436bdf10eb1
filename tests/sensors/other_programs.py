"""The integrations of other programs, written out pixel by pixel."""

import numpy as np


def modes(n):
    """The cosines of n pixels, one a row, of length 1."""
    k, x = np.mgrid[:n, :n]
    rows = np.cos(np.pi * k * (x + 0.5) / n)
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def solved(right):
    """The surface whose Laplacian is `right`, with the eigenvalue of each mode's successor in the place of its own."""
    h, w = right.shape
    down, across = modes(h), modes(w)
    amounts = down @ right @ across.T
    for k in range(h):
        for m in range(w):
            amounts[k, m] /= -4 * (np.sin(np.pi * (k + 1) / (2 * h)) ** 2 + np.sin(np.pi * (m + 1) / (2 * w)) ** 2)
    return down.T @ amounts @ across


def gs_sdk(slopes):
    """Integration of gs_sdk, and of the older gsrobotics: differences of the two neighbours of a pixel."""
    h, w, _ = slopes.shape
    right = np.zeros((h, w))
    for v in range(h):
        for u in range(w):
            right[v, u] += slopes[v, min(u + 1, w - 1), 0] - slopes[v, max(u - 1, 0), 0]
            right[v, u] += slopes[min(v + 1, h - 1), u, 1] - slopes[max(v - 1, 0), u, 1]
            # Slopes out of the image are taken off at its edges, but not at the last pixel but one of each.
            if v != h - 2:
                right[v, u] += slopes[v, u, 0] * (int(u == 0) - int(u == w - 1))
            if u != w - 2:
                right[v, u] += slopes[v, u, 1] * (int(v == 0) - int(v == h - 1))
    surface = solved(right)
    return surface + surface.mean()


def gsrobotics(slopes):
    """Integration of gsrobotics: differences of a pixel and the next; the last repeats the one before."""
    h, w, _ = slopes.shape
    right = np.zeros((h, w))
    for v in range(h):
        for u in range(w):
            left, top = min(u, w - 2), min(v, h - 2)
            right[v, u] += slopes[v, left + 1, 0] - slopes[v, left, 0] + slopes[top + 1, u, 1] - slopes[top, u, 1]
            right[v, u] += slopes[v, u, 0] * (int(u == 0) - int(u == w - 1))
            right[v, u] += slopes[v, u, 1] * (int(v == 0) - int(v == h - 1))
    surface = solved(right)
    return surface - surface.mean()
