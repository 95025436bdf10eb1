"""Weights files: shipped weights, and how weights are found, read, and loaded into a network."""

from pathlib import Path

WEIGHTS = "weights.safetensors"
"""Name of the weights file in a run folder and on the Hugging Face hub."""
DEFAULT = "field"
"""Name of the shipped weights that are used by default."""
SHA256_IN_0_1 = {
    "88463c1af9ade156aac6a52c943aef9316dc68343c3c1587b333359fe484be05": "a48aff982cb3c3c4929fdff8dfb8fc08ced219945f87b808b32c0f48102fd98d",  # noqa: E501
    "d9242ba6c7cf6387823d5f988b6ecfc7b33f78f4566f7a93aa5a83ba2ddd0285": "63e8dc7cdae971801d8739d24b6c9e94834ab5a91e480f362e9bfba8115cbb30",  # noqa: E501
    "b3b1a688bef2c88f29e5e036cfa1de5c7e6f9dca10a3364427c1e40488760fd6": "cd48fcbfdc9882ae486beaca78e6a8b2a7fafcbaa6b75c61671bb4c400843bb1",  # noqa: E501
}
"""Hash of each shipped file to its hash in pcsr 0.1, which had the same weights and another header."""
HERE = Path(__file__).parent
"""Folder of the shipped weights."""


def shipped(recipe: str) -> Path:
    """Return the path of the shipped weights of a recipe. The file may not exist."""
    return HERE / f"{recipe}.safetensors"


def names() -> list[str]:
    """Return the names of all shipped weights."""
    return sorted(path.stem for path in HERE.glob("*.safetensors"))
