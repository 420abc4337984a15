#!/usr/bin/env python3
"""How true a run's depth is: against features triangulated from the photos, and against the plane that most of them lie on.

Nothing that a training run made is used for the truth. SIFT features are matched between photos and triangulated with the
dataset's own cameras; one counts where its rays meet within 0.2 % of their length and two other photos or more agree on
its depth within 3 %. The plane is found among all of them by RANSAC; it is told how many lie within 2 % of the median
depth of it, and it is worth something only where that is most of them, as for a table.

usage: scripts/depth.py NERF DATASET RUN...
prints a line of JSON per run: features, median of |z/z_true - 1| and of z/z_true - 1, share within 5 % and 10 %; the
same medians for all pixels of the plane; the shares of features and of the plane's pixels that truly lie nearer than half
the way to the point where the optical axes cross
needs: numpy, opencv-python-headless, OpenEXR; a transforms.json with one camera for all frames (fl_x, k1 ...)
"""
import json
import os
import re
import subprocess
import sys
import tempfile

import cv2
import numpy as np
import OpenEXR

HOLD_OUT = 8  # every so many frames in natural order is a test view, as in `nerf train`
MOST_VIEWS = 14
GAP = 0.002
AGREE = 0.03
MOST_ANGLE = 60.0


def natural(name):
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


class Photo:
    """A photo with its camera (OpenGL axes, world units) and its features."""

    def __init__(self, folder, data, index):
        frame = data["frames"][index]
        self.index = index
        pose = np.array(frame["transform_matrix"])[:3]
        self.axes = pose[:, :3] / np.linalg.norm(pose[:, :3], axis=0)
        self.eye = pose[:, 3]
        self.size = (int(data["w"]), int(data["h"]))
        self.matrix = np.array([[data["fl_x"], 0, data["cx"]], [0, data["fl_y"], data["cy"]], [0, 0, 1]])
        self.lens = np.array([data.get(name, 0.0) for name in ("k1", "k2", "p1", "p2")])
        image = cv2.imread(os.path.join(folder, frame["file_path"]), cv2.IMREAD_GRAYSCALE)
        keys, found = cv2.SIFT_create(nfeatures=4000, contrastThreshold=0.005, edgeThreshold=20).detectAndCompute(image, None)
        self.pixels = np.array([key.pt for key in keys]) + 0.5
        self.features = np.sqrt(found / (found.sum(1, keepdims=True) + 1e-9)).astype(np.float32)
        self.rays = self.directions(self.pixels)

    def directions(self, pixels):
        """World directions of pixels; the depth along the view axis grows by 1 along each."""
        plane = cv2.undistortPoints(pixels[:, None].astype(np.float64), self.matrix, self.lens)[:, 0]
        return np.stack([plane[:, 0], -plane[:, 1], -np.ones(len(plane))], -1) @ self.axes.T


def triangulate(photo, other, matcher):
    """Features of `photo` that `other` has too, and their depths."""
    angle = np.degrees(np.arccos(np.clip(photo.axes[:, 2] @ other.axes[:, 2], -1, 1)))
    if photo is other or angle > MOST_ANGLE:
        return []
    pairs = [a for a, *b in matcher.knnMatch(photo.features, other.features, k=2) if b and a.distance < 0.75 * b[0].distance]
    if not pairs:
        return []
    own, theirs = np.array([m.queryIdx for m in pairs]), np.array([m.trainIdx for m in pairs])
    a, b, apart = photo.rays[own], other.rays[theirs], other.eye - photo.eye
    normal = np.cross(a, b)
    across = np.linalg.norm(normal, axis=1) + 1e-12
    aa, bb, ab = (a * a).sum(1), (b * b).sum(1), (a * b).sum(1)
    scale = aa * bb - ab * ab + 1e-12
    depth = (bb * (a @ apart) - ab * (b @ apart)) / scale
    depth_there = (ab * (a @ apart) - aa * (b @ apart)) / scale
    length = depth * np.sqrt(aa)
    meet = np.abs(normal @ apart) / across < GAP * np.maximum(length, 1e-3)
    good = meet & (depth > 0) & (depth_there > 0) & (across > 0.1 * np.sqrt(aa * bb))
    return list(zip(own[good], depth[good]))


def truth(photos, test):
    """Per test photo, rows of pixel x, pixel y and depth."""
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    tables = []
    for photo in test:
        depths = {}
        for other in photos:
            for feature, depth in triangulate(photo, other, matcher):
                depths.setdefault(feature, []).append(depth)
        rows = []
        for feature, found in depths.items():
            agreed = [z for z in found if abs(z / np.median(found) - 1) < AGREE]
            if len(agreed) >= 2:
                rows.append([*photo.pixels[feature], np.median(agreed)])
        tables.append(np.array(rows).reshape(-1, 3))
    return tables


def find_plane(points, tolerance):
    """The plane n·p = k that most points lie within `tolerance` of, refined over them, and their share."""
    random = np.random.default_rng(0)
    best = (0, None, None)
    for _ in range(5000):
        a, b, c = points[random.choice(len(points), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        if length > 1e-9:
            normal = normal / length
            best = max(best, ((np.abs((points - a) @ normal) < tolerance).sum(), normal, a), key=lambda found: found[0])
    count, normal, a = best
    on = points[np.abs((points - a) @ normal) < tolerance]
    normal = np.linalg.svd(on - on.mean(0), full_matrices=False)[2][2]
    return normal, normal @ on.mean(0), count / len(points)


def focus_of(photos):
    """The point nearest to all optical axes."""
    eyes, axes = np.array([p.eye for p in photos]), np.array([-p.axes[:, 2] for p in photos])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    return np.linalg.solve(across.sum(0), (across @ eyes[:, :, None]).sum(0)[:, 0])


def rendered_depth(nerf, run, path, photo):
    """Z of a test view at half its size."""
    with tempfile.TemporaryDirectory() as folder:
        width, height = photo.size[0] // 2, photo.size[1] // 2
        frames = f"{photo.index}..{photo.index + 1}"
        subprocess.run([nerf, "render", run, "--cameras", path, "--frames", frames, "--format", "exr", "--width", str(width),
                        "--height", str(height), "--out", folder + "/v", "-q"], check=True, stdout=subprocess.DEVNULL)
        name = next(name for name in os.listdir(folder + "/v") if name.endswith(".exr"))
        return OpenEXR.File(f"{folder}/v/{name}").channels()["Z"].pixels


def compare(nerf, run, path, test, tables, plane):
    errors, plane_errors = [], []
    for photo, table in zip(test, tables):
        z = rendered_depth(nerf, run, path, photo)
        scale = np.array([z.shape[1], z.shape[0]]) / photo.size
        at = np.clip((table[:, :2] * scale).astype(int), 0, [z.shape[1] - 1, z.shape[0] - 1])
        errors.append(z[at[:, 1], at[:, 0]] / table[:, 2] - 1)
        true = plane_depth(photo, plane, z.shape)
        on = np.isfinite(true)
        plane_errors.append((z[on] / true[on]) - 1)
    errors, plane_errors = np.concatenate(errors), np.concatenate(plane_errors)
    return {"run": run, "features": len(errors), "median_error": round(float(np.median(abs(errors))), 4),
            "median_signed": round(float(np.median(errors)), 4), "within_5_percent": round(float((abs(errors) < 0.05).mean()), 3),
            "within_10_percent": round(float((abs(errors) < 0.1).mean()), 3),
            "plane_median_error": round(float(np.median(abs(plane_errors))), 4),
            "plane_median_signed": round(float(np.median(plane_errors)), 4)}


def plane_depth(photo, plane, shape):
    """Depth of the plane for every pixel of a picture of that shape; NaN beyond three times the distance of the focus."""
    normal, offset, far = plane
    x, y = np.meshgrid((np.arange(shape[1]) + 0.5) * photo.size[0] / shape[1], (np.arange(shape[0]) + 0.5) * photo.size[1] / shape[0])
    rays = photo.directions(np.stack([x.ravel(), y.ravel()], -1))
    depth = ((offset - normal @ photo.eye) / (rays @ normal)).reshape(shape)
    return np.where((depth > 0) & (depth < far), depth, np.nan)


def main():
    nerf, folder, *runs = sys.argv[1:]
    path = os.path.join(folder, "transforms.json")
    with open(path, encoding="utf-8-sig") as file:
        data = json.load(file)
    frames = data["frames"]
    there = [i for i in range(len(frames)) if os.path.exists(os.path.join(folder, frames[i]["file_path"]))]
    photos = [Photo(folder, data, i) for i in sorted(there, key=lambda i: natural(frames[i]["file_path"]))]
    test = photos[::HOLD_OUT][:MOST_VIEWS]
    tables = truth(photos, test)
    points = np.concatenate([photo.eye + photo.directions(t[:, :2]) * t[:, 2:] for photo, t in zip(test, tables) if len(t)])
    focus = focus_of(photos)
    ways = [np.linalg.norm(photo.eye - focus) for photo in test]
    near = np.concatenate([t[:, 2] < 0.5 * way for t, way in zip(tables, ways)])
    normal, offset, share = find_plane(points, 0.02 * np.median(np.concatenate(tables)[:, 2]))
    plane = (normal, offset, 3.0 * max(ways))
    true = [plane_depth(photo, plane, (photo.size[1] // 4, photo.size[0] // 4)) for photo in test]
    plane_near = np.mean([np.mean(z < 0.5 * way) for z, way in zip(true, ways)])
    for run in runs:
        result = compare(nerf, run, path, test, tables, plane)
        result |= {"truly_near": round(float(near.mean()), 4), "plane_truly_near": round(float(plane_near), 4),
                   "on_plane": round(float(share), 3)}
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main()
