"""Small valid files of every format that pcsr reads: what the fuzzer starts from."""

import io
import json
import pickle  # noqa: TID251
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

REPOSITORY = Path(__file__).parents[2]
STILL = {"translation": [0, 0, 0], "quaternion": [0, 0, 0, 1], "order": "xyzw"}
RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(20, 3))


@dataclass(frozen=True)
class Seed:
    """A valid input: files by their names in a folder, and what reads them."""

    name: str
    files: dict[str, bytes]
    read: Callable[[Path], object]
    """Of the folder."""
    refused: bool = False
    """Whether even this one is: it is a kind of file that must not be taken."""


def npy(array: np.ndarray, **options: bool) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def image(levels: np.ndarray, kind: str) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(levels).save(file, kind)
    return file.getvalue()


LACKING = {(".obj", "labels"), (".pts", "labels"), (".pts", "colours")}
"""Formats, and clouds whose columns they cannot hold."""


def clouds() -> Iterator[Seed]:
    from pcsr.clouds.cloud import Cloud
    from pcsr.clouds.formats import CLOUD_WRITERS, cloud_bytes, read_cloud, read_points
    from pcsr.metrics.one_cloud import evaluate

    def read(folder: Path) -> None:
        (path,) = folder.iterdir()
        cloud = read_cloud(path)
        read_points(path)
        if len(cloud) < 100:
            evaluate(cloud.points, POINTS)
            evaluate(cloud.points[::-1], cloud.points, frame="each")
            cloud.with_new(cloud.points[:5] + POINTS[:1])

    full = Cloud(
        POINTS,
        {
            "nx": POINTS[:, 0].copy(),
            "ny": POINTS[:, 1].copy(),
            "nz": POINTS[:, 2].copy(),
            "red": RNG.integers(0, 255, 20).astype(np.uint8),
            "green": RNG.integers(0, 255, 20).astype(np.uint8),
            "blue": RNG.integers(0, 255, 20).astype(np.uint8),
        },
    )
    labelled = Cloud(POINTS, {"label": np.arange(20, dtype=np.int32), "weight": RNG.random(20)})
    for suffix in CLOUD_WRITERS:
        for name, cloud in (("plain", Cloud(POINTS)), ("colours", full), ("labels", labelled)):
            if (suffix, name) not in LACKING:
                yield Seed(f"{suffix} {name}", {f"in{suffix}": cloud_bytes(cloud, suffix)}, read)
    for encoding in ("ascii", "binary_big_endian"):
        data = cloud_bytes(Cloud(POINTS, full.columns, {"ply": {"encoding": encoding}}), ".ply")
        yield Seed(f".ply {encoding}", {"in.ply": data}, read)
    for encoding in ("ascii", "binary_compressed"):
        data = cloud_bytes(
            Cloud(POINTS, full.columns, {"pcd": {"encoding": encoding, "packed": ["rgb", "f4"]}}), ".pcd"
        )
        yield Seed(f".pcd {encoding}", {"in.pcd": data}, read)
    block = Cloud(POINTS, {"feature": RNG.random((20, 4))})
    yield Seed(".ply lists", {"in.ply": cloud_bytes(block, ".ply")}, read)
    faces = b"element face 3\nproperty list uchar int vertex_indices\nelement vertex 3\n"
    faces = b"ply\nformat ascii 1.0\n" + faces + b"property float x\nproperty float y\nproperty float z\nend_header\n"
    yield Seed(".ply uneven", {"in.ply": faces + b"3 0 1 2\n4 0 1 2 0\n3 0 1 2\n1 2 3\n4 5 6\n7 8 9\n"}, read)
    rows = b"".join(bytes([n]) + np.arange(n, dtype="<i4").tobytes() for n in (3, 4, 3))
    binary = faces.replace(b"ascii", b"binary_little_endian") + rows + POINTS[:3].astype("<f4").tobytes()
    yield Seed(".ply uneven binary", {"in.ply": binary}, read)
    yield Seed(".npy more", {"in.npy": npy(RNG.random((9, 5)).astype(">f4"))}, read)
    yield Seed(".npy objects", {"in.npy": npy(np.array([{"a": 1}]), allow_pickle=True)}, read, refused=True)
    packed = io.BytesIO()
    np.savez_compressed(packed, points=POINTS, label=np.arange(20), name=np.array("it"))
    yield Seed(".npz packed", {"in.npz": packed.getvalue()}, read)
    csv = b'"time", "Z", "X", "Y"\n0, 3, 1, 2\n1, 4e5, -.1, +2\n'
    yield Seed(".csv names", {"in.csv": csv}, read)
    yield Seed(".txt comments", {"in.txt": b"//X Y Z R G B\n# no\n\n1 2 3 4 5 6\r\n1,2,4,255,0,0\n"}, read)
    yield Seed(".xyz commas", {"in.xyz": b"1,5 2,5 3,5\n1 2 3\n"}, read, refused=True)


def meshes() -> Iterator[Seed]:
    import trimesh

    from pcsr.clouds.formats import read_cloud
    from pcsr.clouds.meshes import read_mesh
    from pcsr.metrics.one_cloud import evaluate

    def read(folder: Path) -> None:
        (path,) = folder.iterdir()
        read_cloud(path)

    def surface(folder: Path) -> None:
        (path,) = folder.iterdir()
        mesh = read_mesh(path)
        if len(mesh.faces) < 100:
            evaluate(POINTS, POINTS, mesh)

    box = trimesh.creation.box()
    box.visual.vertex_colors = np.arange(32).reshape(8, 4).astype(np.uint8)
    assert len(box.vertex_normals) == 8
    scene = trimesh.Scene()
    for shift in (0, 2):
        scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([shift, 0, 0]))
    made = {
        "in.ply": box.export(file_type="ply"),
        "a.ply": box.export(file_type="ply", encoding="ascii"),
        "in.obj": box.export(file_type="obj").encode(),
        "in.off": box.export(file_type="off").encode(),
        "in.stl": box.export(file_type="stl"),
        "a.stl": box.export(file_type="stl_ascii").encode(),
        "in.glb": scene.export(file_type="glb"),
        "n.off": b"CNOFF\n3 1 0\n0 0 0 0 0 1 255 0 0\n1 0 0 0 0 1 0 255 0\n0 1 0 0 0 1 0 0 255\n3 0 1 2\n",
    }
    for name, data in made.items():
        yield Seed(f"mesh {name}", {name: data}, surface)
        yield Seed(f"vertices {name}", {name: data}, read)


def recordings() -> Iterator[Seed]:
    from pcsr.recorded import read
    from pcsr.recorded.images import read_image

    def images(folder: Path) -> None:
        (path,) = folder.iterdir()
        read_image(path)

    levels = np.zeros((16, 16), np.uint8)
    levels[4:9, 5:12] = 40
    deep = np.full((16, 16), 20.0)
    deep[3:9, 5:12] = 18
    png, jpg = image(levels, "png"), image(levels, "jpeg")
    wide = image(levels.astype(np.uint16) * 200, "png")
    for name, data in (("a.png", png), ("a.jpg", jpg), ("b.png", wide), ("a.npy", npy(deep))):
        yield Seed(f"image {name}", {name: data}, images)
    from pcsr.clouds.cloud import Cloud
    from pcsr.clouds.formats import cloud_bytes

    head = {"format": 1, "unit": "mm", "object_unit": "m", "frame": "sensor", "sensor": "digit"}
    identity = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    euler = {"translation": [0, 0, 0], "euler": [10, 20], "axes": "xy", "angle": "degrees"}
    height = {"mm_per_level": 0.03, "mm_per_pixel": 0.1, "indentation": "positive", "contact_above": 0.1}
    eye = {"fx": 10.0, "fy": 10.0, "cx": 8.0, "cy": 8.0}
    touches = [
        {"cloud": "a.csv", "pose": {"matrix": identity, "maps_to": "rigid"}, "contact_area": 3.5},
        {"cloud": "a.npz", "pose": STILL, "unit": "cm", "name": "second"},
        {"height": "a.png", "pose": euler, "mask": "a.jpg", "background": "c.png", **height},
        {"height": "a.png", "pose": STILL, **height, "contact_above": None, "integration": "gs_sdk"},
        {"height": "a.png", "pose": STILL, **height, "contact_above": None, "rest": 0.1},
        {"depth": "a.npy", "pose": STILL, "unit": "mm", "intrinsics": eye, "face": 20.0, "contact_above": 0.5},
        {"fingers": [{"cloud": "a.csv", "pose": STILL}, {"cloud": None, "pose": STILL}], "order": "o.npy"},
    ]
    files = {
        "touches.json": json.dumps({**head, "axes": "+x", "touches": touches}).encode(),
        "a.csv": cloud_bytes(Cloud(POINTS), ".csv"),
        "a.npz": cloud_bytes(Cloud(POINTS), ".npz"),
        "a.png": png,
        "a.jpg": jpg,
        "c.png": image(levels * 0, "png"),
        "a.npy": npy(deep),
        "o.npy": npy(np.arange(20)[::-1].copy()),
    }
    yield Seed("recording", files, read)
    world = {**head, "pose_to": "world", "object_pose": STILL, "touches": touches[:2]}
    few = {name: files[name] for name in ("a.csv", "a.npz")}
    yield Seed("recording in the world", few | {"touches.json": json.dumps(world).encode()}, read)

    def layout(name: str, files: dict[str, bytes], **options: object) -> Seed:
        text = json.dumps({"format": 1, "layout": {"name": name, **options}})
        return Seed(f"layout {name}", {"touches.json": text.encode(), **files}, read)

    pixels = np.stack([*np.mgrid[:6, :4].astype(float), np.zeros((6, 4))], axis=-1).reshape(-1, 3)
    pixels[5, 2] = 20
    common = {"unit": "mm", "object_unit": "mm", "mm_per_pixel": 0.1}
    press = {"indentation": "positive", "contact_above": 0.5, "poses": {"1": STILL}}
    clouds = {"pc_1.pcd": cloud_bytes(Cloud(pixels), ".pcd")}
    yield layout("gsrobotics", clouds, **common, **press, integration="exact")
    low = {"pointcloud_1.pcd": cloud_bytes(Cloud(pixels * [1, 1, 0.1]), ".pcd")}
    yield layout("gsrobotics", low, **common, **press | {"contact_above": None})
    masks = np.zeros((2, 8, 8), bool)
    masks[:, 2:5, 2:5] = True
    trial = {
        "gradient_maps.npy": npy(RNG.normal(size=(2, 8, 8, 2)) * 0.1),
        "contact_masks.npy": npy(masks),
        "a_start_T_currs.npy": npy(np.stack([np.eye(4)] * 2)),
    }
    yield layout("normalflow", trial, **common, start=STILL)
    frame = np.array({"pos": np.array([0.1, 0, 0]), "rot": np.eye(3)}, dtype=object)
    finger = {"0/0_points.npy": npy(POINTS * 0.01), "0/0_ref_frame.npy": npy(frame, allow_pickle=True)}
    yield layout("pterotactyl", finger)
    grasp = {
        "cam_pos": [np.array([0.1, 0.2, 0.7])] * 2,
        "cam_rot": [np.array([0.1, 0.2, 0.3])] * 2,
        "touch_success": [True, False],
        "points": [POINTS * 0.01, []],
    }
    yield layout("smith-2020", {"0.npy": npy(np.array(grasp, dtype=object), allow_pickle=True)})
    slide = {"camposes": np.array([[0.0, 0, 0, 0, 0, 0, 1]]), "more": (1, "b", 2.5)}
    simulated = {
        "tactile_data.pkl": pickle.dumps(slide),
        "gt_heightmaps/0.jpg": jpg,
        "gt_contactmasks/0.jpg": image(levels * 6, "jpeg"),
    }
    yield layout("ycb-slide", simulated, kind="simulated")


def others() -> Iterator[Seed]:
    import torch
    from safetensors.torch import save

    from pcsr.data.dataset import Split
    from pcsr.data.shards import read_card, read_clouds, read_manifest
    from pcsr.plugins.loading import load_plugins
    from pcsr.recipe import load
    from pcsr.weights.file import read_file

    registry = load_plugins(())

    def weights(folder: Path) -> None:
        read_file(folder / "weights.safetensors")

    def data(folder: Path) -> None:
        for split in read_manifest(folder).splits:
            Split.load(folder, split)

    def shard(folder: Path) -> None:  # without the manifest, whose hash would refuse most of the damaged ones
        (path,) = folder.iterdir()
        read_card(path)
        read_clouds(path)

    def recipe(folder: Path) -> None:
        (path,) = folder.iterdir()
        load(path, registry)

    card = {"pcsr": json.dumps({"recipe": {"name": "a"}, "version": "0.1.0", "parts": []})}
    yield Seed("weights", {"weights.safetensors": save({"a.weight": torch.ones(3, 2)}, card)}, weights)
    files = {path.name: path.read_bytes() for path in sorted((REPOSITORY / "tests/data/version_0_1").iterdir())}
    yield Seed("data", files, data)
    yield Seed("shard", {"test-00000.safetensors": files["test-00000.safetensors"]}, shard)
    for path in sorted((REPOSITORY / "pcsr/recipes").glob("*.yaml")):
        text = path.read_bytes()
        if b".yaml" not in text:
            yield Seed(f"recipe {path.name}", {path.name: text}, recipe)


KINDS = {"clouds": clouds, "meshes": meshes, "recordings": recordings, "others": others}
"""Seeds of each kind."""
