"""Ray-traced light against what a plane, a ball, a box and a wall have in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from skincli.mesh.model import Mesh, Part
from skincli.reference.rays import METER, Panorama, arriving, coverage, irradiance, spot_falloff, visibility
from skincli.scene.model import Camera, DirectionalLight, PointLight, SpotLight

UP = np.array([0.0, 0.0, 1.0])
ORIGIN = np.array([1000.0, -2000.0, 500.0])


def mesh_of(*bodies: trimesh.Trimesh) -> Mesh:
    """Return bodies as one mesh that lies at ORIGIN in its scene."""
    body = trimesh.util.concatenate(bodies)
    uv = np.zeros((len(body.vertices), 2))
    parts = (Part("all", 0, len(body.faces)),)
    faces = body.faces.astype(np.int32)
    return Mesh(np.array(body.vertices), np.array(body.vertex_normals), uv, uv, faces, parts, ORIGIN)


def plane(side: float = 2000.0) -> trimesh.Trimesh:
    """Return a thin slab whose upper face is z = 0."""
    return trimesh.creation.box((side, side, 1.0), trimesh.transformations.translation_matrix((0, 0, -0.5)))


def sun(*direction: float) -> DirectionalLight:
    return DirectionalLight(type="directional", direction=direction, irradiance=(3.0, 2.0, 1.0))


def lamp(*position: float) -> PointLight:
    return PointLight(type="point", position=tuple(position + ORIGIN), intensity=(0.5, 1.0, 2.0))


def on_plane(x: np.ndarray, y: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    points = np.stack(np.broadcast_arrays(x, y, 0.0), axis=-1).astype(float)
    return points, np.broadcast_to(UP, points.shape)


def test_the_shadow_of_a_ball_is_an_ellipse_under_the_sun() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=10.0)
    ball.apply_translation((0, 0, 50))
    points, normals = on_plane(*(np.random.default_rng(1).uniform(-80, 80, (2, 4000))))
    light = sun(1.0, 0.0, -1.0)
    (seen,) = visibility(mesh_of(plane(), ball), points, normals, [light])
    # The distance of the ball's middle from the ray towards the sun.
    toward = np.array([-1.0, 0.0, 1.0]) / math.sqrt(2)
    to_middle = np.array([0, 0, 50.0]) - points
    distance = np.linalg.norm(to_middle - (to_middle @ toward)[:, None] * toward, axis=1)
    sure = np.abs(distance - 10.0) > 0.02
    assert sure.mean() > 0.99
    np.testing.assert_array_equal(seen[sure], (distance > 10.0)[sure])


def test_a_lamp_in_a_box_is_seen_inside_only() -> None:
    box = trimesh.creation.box((100.0, 100.0, 100.0))
    middle = np.array([[0.0, 0, 40], [30, -20, -45], [0, 0, 60], [300, 0, 0]])
    inside, outside = visibility(mesh_of(box), middle, np.tile(UP, (4, 1)), [lamp(10.0, 0, 0), lamp(0, 0, 80)])
    np.testing.assert_array_equal(inside, [True, True, False, False])
    np.testing.assert_array_equal(outside, [False, False, True, True])


def test_what_lies_beyond_the_lamp_casts_no_shadow() -> None:
    lid = plane(300.0)
    lid.apply_translation((0, 0, 100))
    points, normals = on_plane(np.linspace(-50, 50, 11))
    below, above = visibility(mesh_of(plane(), lid), points, normals, [lamp(0, 0, 90), lamp(0, 0, 110)])
    assert below.all()
    assert not above.any()


def test_lamps_give_what_is_written_at_one_meter() -> None:
    points, normals = on_plane(np.array([0.0, 1000.0]))
    found = irradiance(mesh_of(plane(4000.0)), points, normals, [lamp(0, 0, METER)])
    # At one meter's offset: twice the squared distance, and 45 degrees.
    np.testing.assert_allclose(found, [[0.5, 1.0, 2.0], np.array([0.5, 1.0, 2.0]) / (2 * math.sqrt(2))], rtol=1e-12)


def test_sun_follows_the_cosine_and_lights_add_up() -> None:
    points, normals = on_plane(np.array([5.0]))
    mesh = mesh_of(plane())
    lights = [sun(0, 1, -1), sun(0, 0, 1), lamp(0, 0, 500)]
    alone = [irradiance(mesh, points, normals, [light]) for light in lights]
    np.testing.assert_allclose(alone[0], [np.array([3.0, 2.0, 1.0]) / math.sqrt(2)], rtol=1e-12)
    assert not alone[1].any()  # from below
    np.testing.assert_allclose(irradiance(mesh, points, normals, lights), sum(alone), rtol=1e-12)


@pytest.mark.parametrize("blend", [0.0, 0.3, 1.0])
def test_a_spot_fades_smoothly_to_its_edge(blend: float) -> None:
    spot = SpotLight(
        type="spot", position=(0.0, 0, 1000), direction=(0.0, 0, -3), intensity=(1.0, 1, 1), angle=60.0, blend=blend
    )
    degrees = np.array([0.0, 30 * (1 - blend) - 0.01, 30.01, 120.0])
    share = spot_falloff(spot, np.cos(np.radians(degrees)))
    np.testing.assert_allclose(share, [1, 1, 0, 0], atol=1e-12)
    middle = 0.5 * (math.cos(math.radians(30)) + math.cos(math.radians(30 * (1 - blend))))
    if blend > 0:
        np.testing.assert_allclose(spot_falloff(spot, np.array([middle])), [0.5], rtol=1e-12)
    points = np.array([[0.0, 0, 0], [0, 0, 3000]])
    _, found = arriving(spot, points)
    np.testing.assert_allclose(found, [[1.0, 1, 1], [0, 0, 0]], rtol=1e-12)


def test_constant_light_from_around_gives_pi_l_and_half_beside_a_wall() -> None:
    points, normals = on_plane(np.array([0.0, 3.0]), np.array([0.0, 0.0]))
    open_plane = irradiance(mesh_of(plane()), points, normals, ambient=(0.5, 1.0, 2.0), samples=256)
    np.testing.assert_allclose(open_plane, np.pi * np.tile([0.5, 1.0, 2.0], (2, 1)), rtol=1e-12)
    # A wall just beside the first point that reaches far beyond all of it hides half its sky.
    wall = trimesh.creation.box((1.0, 1e5, 1e5), trimesh.transformations.translation_matrix((-0.51, 0, 0)))
    sky = Panorama(np.full((4, 8, 3), 0.7), 0.0)
    found = irradiance(
        mesh_of(plane(1e5), wall),
        np.add(points, [2.0, 0, 0]),
        normals,
        environment=sky,
        ambient=(0.3, 0.3, 0.3),
        samples=4096,
    )
    np.testing.assert_allclose(found, 0.5 * np.pi * np.ones((2, 3)), rtol=2e-3)


def test_environment_is_placed_and_turned_as_written() -> None:
    image = np.zeros((64, 128, 3))
    image[:, 64:96] = 1.0  # from the middle, -Z, to +X
    axes = np.array([[1.0, 0, -1], [1, 0, 1], [-1, 0, 1], [-1, 0, -1]])
    np.testing.assert_array_equal(Panorama(image, 0.0).radiance(axes)[:, 0], [1, 0, 0, 0])
    # Counter-clockwise from above, +X turns towards -Z, and what was seen at +X -Z goes to -X -Z.
    np.testing.assert_array_equal(Panorama(image, 90.0).radiance(axes)[:, 0], [0, 0, 0, 1])
    image = np.zeros((64, 128, 3))
    image[:16] = 1.0
    found = Panorama(image, 12.0).radiance(np.array([[0.0, 1, 0], [0, 0.9, 0.1], [0, 0, 1], [0, -1, 0]]))
    np.testing.assert_array_equal(found[:, 0], [1, 1, 0, 0])


def test_half_a_sky_in_the_picture_gives_its_analytic_irradiance() -> None:
    image = np.zeros((256, 512, 3))
    image[: 256 // 4] = 2.0  # within 45 degrees of the zenith, which is +Y
    body = trimesh.creation.icosphere(subdivisions=3, radius=5.0)
    point = body.vertices[[np.argmax(body.vertices[:, 1])]]
    found = irradiance(mesh_of(body), point, np.array([[0.0, 1, 0]]), environment=Panorama(image, 0.0), samples=4096)
    np.testing.assert_allclose(found, 2.0 * np.pi * 0.5 * np.ones((1, 3)), rtol=1e-2)


def test_coverage_of_a_ball_is_the_area_of_its_disk() -> None:
    ball = mesh_of(trimesh.creation.icosphere(subdivisions=5, radius=50.0))
    camera = Camera(position=tuple(np.add(ORIGIN, [0, 0, 5000.0])), target=tuple(ORIGIN), fov=2.0)
    found = coverage(ball, camera, (60, 40), samples=4)
    half_height = math.tan(math.asin(50 / 5000)) / math.tan(math.radians(1)) * 20
    assert found.shape == (40, 60)
    assert (found[0] == 0).all()
    assert found[20, 30] == 1.0
    np.testing.assert_allclose(found.sum(), math.pi * half_height**2, rtol=5e-3)
    moved = Camera(position=camera.position, target=tuple(np.add(ORIGIN, [30.0, -20, 0])), fov=2.0)
    rows, columns = np.nonzero(coverage(ball, moved, (60, 40)))
    # A camera that looks right of the ball and below it sees it left of the middle and above.
    assert columns.mean() < 29 - 5
    assert rows.mean() < 19 - 3


def test_no_rays_are_refused() -> None:
    points, normals = on_plane(np.zeros(1))
    with pytest.raises(ValueError, match="1 or more"):
        irradiance(mesh_of(plane()), points, normals, samples=0)
