"""Other methods of denoising a cloud, beside which `pcsr upsample --denoise` is measured."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

Points = Float[np.ndarray, "_ 3"]
NEIGHBOURS = 16
"""Neighbours of the bilateral filter, of outlier removal, and of Open3D's normals."""
ROUNDS = 1
"""Rounds of the bilateral filter, with which, and with `NEIGHBOURS`, it leaves the least error on PU-GAN's shapes."""
STRAY = 2.0
"""Points are outliers if they are so many standard deviations farther from their neighbours than the mean."""
SMOOTHING = 10
"""Rounds of Taubin's filter."""


def bilateral(points: Points, level: float) -> Points:
    """Move points along their normals by a bilateral filter.

    Digne and de Franchis, "The bilateral filter for point clouds" (IPOL 2017): a point moves by the mean height of its
    neighbours over its tangent plane, weighted by their distances and by the heights.

    Args:
        points: the cloud.
        level: standard deviation of the noise, of which the heights' scale is twice as much.
    """
    for _ in range(ROUNDS):
        distance, index = cKDTree(points).query(points, k=NEIGHBOURS)
        offsets = points[index] - points[:, None]
        centred = offsets - offsets.mean(1, keepdims=True)
        normal = np.linalg.eigh(centred.mT @ centred)[1][..., :1]
        height = (offsets @ normal)[..., 0]
        weight = np.exp(-2 * (distance / distance[:, -1:]) ** 2 - (height / (2 * level)) ** 2 / 2)
        points = points + ((weight * height).sum(1) / weight.sum(1))[:, None] * normal[..., 0]
    return points


def open3d_outliers(points: Points) -> Points:
    """The cloud without the points that Open3D takes for statistical outliers.

    Raises:
        ImportError: Open3D is not installed.
    """
    return np.asarray(_open3d_cloud(points).points)


def open3d_surface(points: Points, count: int) -> Points:
    """Points of Open3D's Poisson surface, smoothed by Taubin's filter, without what it closes far from the cloud.

    Raises:
        ImportError: Open3D is not installed.
    """
    import open3d

    cloud = _open3d_cloud(points)
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    cloud.orient_normals_consistent_tangent_plane(NEIGHBOURS)
    mesh = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=8, n_threads=1)[0]
    mesh = mesh.filter_smooth_taubin(SMOOTHING)
    tree = cKDTree(points)
    reach = 3 * np.median(tree.query(points, k=2)[0][:, 1])
    mesh.remove_vertices_by_mask(tree.query(np.asarray(mesh.vertices))[0] > reach)
    open3d.utility.random.seed(0)
    return np.asarray(mesh.sample_points_poisson_disk(count).points)


def _open3d_cloud(points: Points):
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    return cloud.remove_statistical_outlier(NEIGHBOURS, STRAY)[0]


def installed() -> bool:
    """Whether Open3D can be imported."""
    try:
        import open3d  # noqa: F401
    except (ImportError, OSError):
        return False
    return True
