"""Makes studio.exr, the room that the example scenes mirror: soft boxes over a dim wall, floor and ceiling.

Run from anywhere: python examples/environments/make.py
"""

from pathlib import Path

import numpy as np

from skincli.images import write_exr

WIDTH = 512
#: degrees over which a box fades: the mirror images are sharp, so the lights must not be
EDGE = 9.0


def softbox(rays: np.ndarray, center: tuple[float, float], size: tuple[float, float], color: list[float]) -> np.ndarray:
    """Return the radiance of a box with soft edges, brighter in its middle.

    Parameters
    ----------
    rays : (h, w, 2) longitude and latitude, degrees; longitude 0 is +Z, 90 is +X
    center, size : longitude and latitude of the middle; width and height, degrees
    color : linear Rec.709 radiance
    """
    away = np.abs(rays - center)
    away[..., 0] = np.minimum(away[..., 0], 360 - away[..., 0])
    edge = np.clip((np.array(size) / 2 - away) / EDGE + 0.5, 0, 1)
    inside = np.prod(edge * edge * (3 - 2 * edge), axis=-1)
    glow = 1 - 0.45 * np.sum((away / (np.array(size) / 2)) ** 2, axis=-1).clip(0, 1)
    return (inside * glow)[..., None] * np.array(color)


def studio() -> np.ndarray:
    """Return (256, 512, 3) radiance, the zenith in the top row, -Z in the middle column."""
    latitude = 90 - (np.arange(WIDTH // 2) + 0.5) / (WIDTH // 2) * 180
    longitude = (np.arange(WIDTH) + 0.5) / WIDTH * 360 - 180
    # The middle column looks along -Z; the camera's back, and the lights in front of the face, are at +Z.
    rays = np.stack(np.meshgrid(180 - longitude % 360, latitude), axis=-1)
    up = np.sin(np.radians(latitude))[:, None, None]
    wall = np.array([0.16, 0.17, 0.19]) * (1 + 0.35 * up)
    floor = np.array([0.1, 0.085, 0.07]) * (1 + 0.5 * np.clip(-up, 0, 1))
    blend = np.clip(up * 8 + 0.5, 0, 1)
    room = floor * (1 - blend) + wall * blend + np.zeros((1, WIDTH, 1))
    room = room + softbox(rays, (-38, 32), (46, 34), [7.5, 7.0, 6.4])
    room = room + softbox(rays, (62, 12), (26, 52), [1.5, 1.7, 2.0])
    room = room + softbox(rays, (150, 24), (18, 56), [4.2, 4.4, 4.8])
    room = room + softbox(rays, (-142, 10), (14, 60), [3.2, 2.8, 2.4])
    return room + softbox(rays, (0, 82), (120, 14), [1.4, 1.4, 1.4])


if __name__ == "__main__":
    write_exr(Path(__file__).with_name("studio.exr"), {"beauty": studio().astype(np.float32)})
