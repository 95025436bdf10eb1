"""Changes of valid files: flipped bits, cut and doubled parts, lengths and numbers at the ends of their range."""

import io
import json
import random
import re
import struct
import zipfile
from collections.abc import Callable
from contextlib import suppress
from typing import Any

WORDS = (
    *(b"0", b"-1", b"1", b"255", b"256", b"2147483647", b"4294967295", b"9223372036854775807", b"1e300", b"-1e300"),
    *(b"1e-300", b"1e999", b"nan", b"inf", b"1000000000000", b"1" * 5000, b"0x10", b"", b"1.5", b"_", b"\xff", b"\0"),
)
VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1, 2**31, 2**63, 10**400, 0.5, 1e300, 1e-300, -1e308, float("nan"), float("inf")),
    *("", "a", "\0", "../a", "~nobody", "/dev/zero", "a" * 300, [], [1], [[]], {}, {"a": 1}, [0] * 1000),
)
NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
LENGTHS = (0, 1, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1)


def bits(data: bytearray, rng: random.Random, _: bytes) -> None:
    for _ in range(rng.choice((1, 1, 2, 8))):
        data[_place(data, rng)] ^= 1 << rng.randrange(8)


def cut(data: bytearray, rng: random.Random, _: bytes) -> None:
    del data[_place(data, rng) :]


def remove(data: bytearray, rng: random.Random, _: bytes) -> None:
    at = _place(data, rng)
    del data[at : at + rng.choice((1, 4, 16, 100))]


def double(data: bytearray, rng: random.Random, _: bytes) -> None:
    at = _place(data, rng)
    part = data[at : at + rng.choice((1, 4, 16, 100, 1000))]
    data[at:at] = part * rng.choice((1, 1, 2, 100, 2000))


def splice(data: bytearray, rng: random.Random, other: bytes) -> None:
    if other:
        at, there = _place(data, rng), rng.randrange(len(other))
        size = rng.choice((4, 16, 100, 1000, len(other)))
        data[at : at + rng.choice((0, size))] = other[there : there + size]


def number(data: bytearray, rng: random.Random, _: bytes) -> None:
    start = 0 if rng.random() < 0.7 else _place(data, rng)
    found = list(NUMBER.finditer(data[start : start + 2000]))
    if found:
        one = rng.choice(found)
        data[start + one.start() : start + one.end()] = rng.choice(WORDS)


def length(data: bytearray, rng: random.Random, _: bytes) -> None:
    size, order = rng.choice((1, 2, 4, 8)), rng.choice(("little", "big"))
    at = _place(data, rng)
    data[at : at + size] = (rng.choice(LENGTHS) % 2 ** (8 * size)).to_bytes(size, order)


def double_number(data: bytearray, rng: random.Random, _: bytes) -> None:
    value = rng.choice((0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-200, float("nan"), float("inf")))
    at = _place(data, rng)
    data[at : at + 8] = struct.pack("<d", value)


def noise(data: bytearray, rng: random.Random, _: bytes) -> None:
    at = _place(data, rng)
    data[at : at + rng.choice((0, 4, 16))] = rng.randbytes(rng.choice((1, 4, 16, 100)))


def word(data: bytearray, rng: random.Random, _: bytes) -> None:
    found = list(re.finditer(rb"[A-Za-z_]+", data[:4000]))
    if found:
        one, two = rng.choice(found), rng.choice(found)
        data[one.start() : one.end()] = rng.choice((two.group(), b"", one.group() * 2, one.group()[::-1]))


BLIND: tuple[Callable[[bytearray, random.Random, bytes], None], ...] = (
    *(bits, cut, remove, double, splice, number, number, length, length, double_number, noise, word),
)


def _place(data: bytearray, rng: random.Random) -> int:
    """Where to change something: at the beginning, where headers are, as often as in all the rest."""
    size = max(len(data), 1)
    place = rng.randrange(min(size, 400)) if rng.random() < 0.5 else rng.randrange(size)
    if not data:
        data.append(0)
    return place


def mutated(name: str, data: bytes, rng: random.Random, other: bytes) -> bytes:
    """One to four changes of a file; `other` is another valid one, for parts to be taken from."""
    inner = INSIDE.get(name.rpartition(".")[2])
    if inner and rng.random() < 0.5:
        with suppress(ValueError, LookupError, zipfile.BadZipFile, struct.error):
            return inner(data, rng)
    return _blind(data, rng, other)


def _blind(data: bytes, rng: random.Random, other: bytes = b"") -> bytes:
    made = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 3, 4))):
        rng.choice(BLIND)(made, rng, other)
    return bytes(made[: 1 << 22])


def _in_zip(data: bytes, rng: random.Random) -> bytes:
    """A change inside of a member: changed from outside, checksums would not fit."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new:
        names = old.namelist()
        chosen = rng.choice(names)
        for name in names:
            content = old.read(name)
            new.writestr(name, _blind(content, rng) if name == chosen else content)
    return made.getvalue()


def _in_json(data: bytes, rng: random.Random) -> bytes:
    """Another value somewhere in a JSON."""
    tree = [json.loads(data)]
    items: list[tuple[Any, Any]] = []

    def walk(node: Any) -> None:
        for key in node if isinstance(node, dict) else range(len(node)):
            items.append((node, key))
            if isinstance(node[key], dict | list):
                walk(node[key])

    walk(tree)
    for _ in range(rng.choice((1, 1, 2))):
        node, key = rng.choice(items)
        if rng.random() < 0.2:
            del node[key]
            break
        node[key] = rng.choice(VALUES)
    return json.dumps(tree[0] if tree else None).encode()


def _in_safetensors(data: bytes, rng: random.Random) -> bytes:
    """Another value in a header, whose length is right."""
    size = int.from_bytes(data[:8], "little")
    head = json.loads(data[8 : 8 + size])
    if rng.random() < 0.5 and "pcsr" in head.get("__metadata__", {}):
        head["__metadata__"]["pcsr"] = _in_json(head["__metadata__"]["pcsr"].encode(), rng).decode()
        text = json.dumps(head).encode()
    else:
        text = _in_json(json.dumps(head).encode(), rng)
    return len(text).to_bytes(8, "little") + text + data[8 + size :]


def _in_glb(data: bytes, rng: random.Random) -> bytes:
    """Another value in a scene, whose lengths are right."""
    size = int.from_bytes(data[12:16], "little")
    text = _in_json(data[20 : 20 + size], rng)
    text += b" " * (-len(text) % 4)
    rest = data[20 + size :]
    return data[:8] + struct.pack("<II", 20 + len(text) + len(rest), len(text)) + b"JSON" + text + rest


INSIDE = {"npz": _in_zip, "json": _in_json, "safetensors": _in_safetensors, "glb": _in_glb}
"""Changes that know the format, by suffix."""
