"""Density images: every kind of PNG against an encoder of our own, JPEG, EXR, NumPy files, and everything damaged."""

from __future__ import annotations

import pickle
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from esh import InputFileError
from esh.engine.files.image_files import read_color, read_density
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_bytes(samples: np.ndarray, color_type: int, bits: int, *extra: bytes, filtered: bool = True) -> bytes:
    """Encode samples of shape [height, width, channels] straight from the PNG specification, no image library."""
    height, width = samples.shape[:2]
    raw = samples.astype(">u2" if bits == 16 else np.uint8).reshape(height, -1).view(np.uint8).reshape(height, -1)
    step = max(1, samples.shape[2] * bits // 8)
    lines = []
    for row in range(height):
        line = raw[row].astype(int)
        if filtered and row % 2:  # "sub": every byte minus that of the pixel before
            before = np.concatenate([np.zeros(step, int), line[:-step]])
            lines.append(bytes([1]) + ((line - before) % 256).astype(np.uint8).tobytes())
        else:
            lines.append(bytes([0]) + raw[row].tobytes())
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, color_type, 0, 0, 0))
    return (
        b"\x89PNG\r\n\x1a\n"
        + header
        + b"".join(extra)
        + chunk(b"IDAT", zlib.compress(b"".join(lines)))
        + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("color_type", [0, 2, 4, 6])
@pytest.mark.parametrize("invert", [False, True])
def test_png_of_every_kind_is_read_to_its_last_bit(tmp_path, bits, color_type, invert):
    most = 2**bits - 1
    samples = np.random.default_rng(color_type).integers(1, most, (5, 7, CHANNELS[color_type]))
    path = tmp_path / "image.png"
    path.write_bytes(png_bytes(samples, color_type, bits))
    value = samples / most
    luminance = value[..., :3] @ WEIGHTS if color_type in (2, 6) else value[..., 0]
    expected = (1 - luminance if invert else luminance) * (value[..., -1] if color_type in (4, 6) else 1)
    # Well below the step of the format, so that no lower byte can be missing.
    np.testing.assert_allclose(read_density(path, invert), expected, atol=0.05 / most + 3e-7)


def test_sixteen_bits_tell_neighboring_values_apart(tmp_path):
    path = tmp_path / "ramp.png"
    path.write_bytes(png_bytes(np.arange(1, 1025).reshape(16, 64, 1), 0, 16))
    assert len(np.unique(read_density(path, False))) == 1024


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("color_type", [0, 2])
def test_the_transparent_color_holds_nothing(tmp_path, bits, color_type):
    channels = CHANNELS[color_type]
    samples = np.full((2, 3, channels), 200)
    samples[0, 1] = 77
    path = tmp_path / "image.png"
    path.write_bytes(
        png_bytes(samples, color_type, bits, chunk(b"tRNS", struct.pack(f">{channels}H", *[77] * channels)))
    )
    density = read_density(path, False)
    assert density[0, 1] == 0 and (np.delete(density.ravel(), 1) > 0).all()


def test_palettes_are_looked_up(tmp_path):
    path = tmp_path / "palette.png"
    palette = chunk(b"PLTE", bytes([0, 0, 0, 255, 255, 255, 255, 0, 0]))
    path.write_bytes(png_bytes(np.array([[[0], [1], [2], [1]]]), 3, 8, palette))
    np.testing.assert_allclose(read_density(path, False), [[0, 1, 0.2126, 1]], atol=1e-6)
    path.write_bytes(png_bytes(np.array([[[0], [1], [2], [1]]]), 3, 8, palette, chunk(b"tRNS", bytes([255, 0, 255]))))
    np.testing.assert_allclose(read_density(path, False), [[0, 0, 0.2126, 0]], atol=1e-6)


def test_black_and_white_of_one_bit(tmp_path):
    Image.fromarray(np.array([[0, 255], [255, 0]], np.uint8)).convert("1").save(tmp_path / "mask.png")
    np.testing.assert_array_equal(read_density(tmp_path / "mask.png", False), [[0, 1], [1, 0]])


@pytest.mark.parametrize("mode", ["L", "RGB", "CMYK"])
def test_jpeg(tmp_path, mode):
    gray = np.tile(np.linspace(20, 235, 64), (48, 1)).astype(np.uint8)
    Image.fromarray(gray).convert("RGB").convert(mode).save(tmp_path / "image.JPG", format="JPEG", quality=98)
    density = read_density(tmp_path / "image.JPG", False)
    np.testing.assert_allclose(density, gray / 255, atol=0.03)
    np.testing.assert_allclose(read_density(tmp_path / "image.JPG", True), 1 - density, atol=1e-6)


def test_a_photograph_lies_as_it_is_seen(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 3  # stored upside down
    image = np.full((16, 16), 30, np.uint8)
    image[:8] = 220
    Image.fromarray(image).save(tmp_path / "turned.jpg", exif=exif, quality=98)
    density = read_density(tmp_path / "turned.jpg", False)
    assert density[:7].max() < 0.3 < 0.7 < density[9:].min()


def write_exr(path: Path, channels: dict, **header) -> None:
    OpenEXR = pytest.importorskip("OpenEXR")
    with OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}, channels
    ) as file:
        file.write(str(path))


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_exr_color_luminance_and_single_channels(tmp_path, dtype):
    value = np.random.default_rng(1).random((6, 9, 3)).astype(dtype) * dtype(4)
    path = tmp_path / "image.exr"
    write_exr(path, {"RGB": value})
    np.testing.assert_allclose(read_density(path, False), value.astype(float) @ WEIGHTS, rtol=1e-5)
    for name in ("Y", "density"):
        write_exr(path, {name: np.ascontiguousarray(value[..., 0])})
        np.testing.assert_array_equal(read_density(path, False), value[..., 0].astype(np.float32))
    write_exr(path, {"X": np.ascontiguousarray(value[..., 0]), "Z": np.ascontiguousarray(value[..., 1])})
    with pytest.raises(InputFileError, match="must have the channels R, G and B, or Y, or only one; got X, Z"):
        read_density(path, False)


def test_exr_alpha_is_premultiplied_already(tmp_path):
    color = np.full((2, 2, 4), 0.5, np.float32)
    color[0, 0] = 0.0
    color[1, 1, :3] = 0.125
    write_exr(tmp_path / "image.exr", {"RGBA": color})
    np.testing.assert_allclose(read_density(tmp_path / "image.exr", False), [[0, 0.5], [0.5, 0.125]], atol=1e-6)
    # 1 - 0.125 / 0.5 of what is half there.
    np.testing.assert_allclose(read_density(tmp_path / "image.exr", True), [[0, 0], [0, 0.375]], atol=1e-6)


def test_damaged_exr(tmp_path, capfd):
    path = tmp_path / "image.exr"
    write_exr(
        path, {"RGB": np.ones((40, 40, 3), np.float32) * np.random.default_rng(0).random((40, 40, 1)).astype("f")}
    )
    whole = path.read_bytes()
    for damaged in (b"", b"not an image", whole[:30], whole[: len(whole) // 2], whole[:-5]):
        path.write_bytes(damaged)
        with pytest.raises(InputFileError, match=r"image\.exr .*an image is a PNG, JPEG, EXR or \.npy file"):
            read_density(path, False)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.5])
@pytest.mark.parametrize("ending", [".npy", ".exr"])
def test_values_without_meaning(tmp_path, bad, ending):
    value = np.ones((4, 4), np.float32)
    value[2, 1] = bad
    path = tmp_path / f"image{ending}"
    np.save(path, value) if ending == ".npy" else write_exr(path, {"Y": value})
    with pytest.raises(InputFileError, match=f"image{ending} must be (finite|0 or more) everywhere"):
        read_density(path, False)


@pytest.mark.parametrize(("value", "invert"), [(0, False), (255, True)])
def test_images_that_are_zero_everywhere(tmp_path, value, invert):
    Image.fromarray(np.full((4, 4), value, np.uint8)).save(tmp_path / "flat.png")
    with pytest.raises(InputFileError, match=r"flat\.png.* must be above 0 somewhere; it is 0 everywhere"):
        read_density(tmp_path / "flat.png", invert)


@pytest.mark.parametrize(
    ("dtype", "most"), [(np.uint8, 255), (np.uint16, 65535), (bool, 1), (np.int64, 1), (np.float64, 1), (np.float16, 1)]
)
def test_npy_of_every_type(tmp_path, dtype, most):
    value = np.array([[0, 1], [1, 0]], dtype)
    np.save(tmp_path / "image.npy", np.asfortranarray(value))
    np.testing.assert_allclose(read_density(tmp_path / "image.npy", False), value / most)
    np.testing.assert_allclose(read_density(tmp_path / "image.npy", True), 1 - value.astype(float) / most)


def test_inverting_needs_values_up_to_one(tmp_path):
    np.save(tmp_path / "high.npy", np.array([[0.5, 3.0]]))
    assert read_density(tmp_path / "high.npy", False).max() == 3
    with pytest.raises(InputFileError, match=r"cannot be inverted.*between 0 and 1; the largest is 3"):
        read_density(tmp_path / "high.npy", True)


class _Bomb:
    """Unpickling it leaves a file behind."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_npy_never_unpickles(tmp_path):
    trace = tmp_path / "trace"
    np.save(tmp_path / "objects.npy", np.array([[_Bomb(trace)]], dtype=object), allow_pickle=True)
    (tmp_path / "pickle.npy").write_bytes(pickle.dumps(_Bomb(trace)))
    with pytest.raises(InputFileError, match=r"objects\.npy holds Python objects, which are never loaded"):
        read_density(tmp_path / "objects.npy", False)
    with pytest.raises(InputFileError, match=r"pickle\.npy is damaged, or not a \.npy file"):
        read_density(tmp_path / "pickle.npy", False)
    assert not trace.exists()


@pytest.mark.parametrize("shape", [(), (3,), (2, 2, 3), (0, 4), (4, 0)])
def test_npy_must_be_an_image(tmp_path, shape):
    np.save(tmp_path / "image.npy", np.ones(shape))
    with pytest.raises(InputFileError, match=r"image\.npy"):
        read_density(tmp_path / "image.npy", False)


@pytest.mark.parametrize("dtype", [complex, "U3", "datetime64[s]", [("a", float)]])
def test_npy_must_hold_numbers(tmp_path, dtype):
    np.save(tmp_path / "image.npy", np.zeros((2, 2), dtype))
    with pytest.raises(InputFileError, match="must hold numbers; got the type"):
        read_density(tmp_path / "image.npy", False)


def test_a_claimed_size_is_not_believed(tmp_path):
    with (tmp_path / "claim.npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)})
        file.write(b"12345678")
    with pytest.raises(InputFileError, match=r"claim\.npy is damaged"):
        read_density(tmp_path / "claim.npy", False)
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 10**6, 10**6, 8, 0, 0, 0, 0))
    (tmp_path / "bomb.png").write_bytes(b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"0" * 99)))
    with pytest.raises(InputFileError, match=r"bomb\.png claims .*pixels"):
        read_density(tmp_path / "bomb.png", False)


def test_files_that_are_not_there_or_of_another_kind(tmp_path):
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "text.png").write_text("hello")
    (tmp_path / "empty.jpg").write_bytes(b"")
    for name, complaint in {
        "absent.png": "does not exist",
        "folder.png": "is a folder",
        "text.png": "is neither a PNG nor a JPEG",
        "empty.jpg": "is empty: save or copy it again",
        "image.tiff": "not of a kind that can be read.*got the ending '.tiff'",
        "image": "got the ending ''",
        "nul\0.png": "png",
        "x" * 5000 + ".png": "cannot be read",
    }.items():
        with pytest.raises(InputFileError, match=complaint):
            read_density(tmp_path / name, False)


@pytest.mark.parametrize("name", ["whole.png", "whole.jpg"])
def test_a_picture_that_was_cut_short_is_called_so(tmp_path, name):
    path = tmp_path / name
    noise = np.random.default_rng(0).integers(0, 255, (64, 64)).astype(np.uint8)
    Image.fromarray(noise).save(path)
    whole = path.read_bytes()
    assert read_density(path).shape == (64, 64)
    for length in (3, 20, len(whole) // 2, len(whole) - 50):
        path.write_bytes(whole[:length])
        with pytest.raises(InputFileError) as refusal:
            read_density(path)
        sentence = str(refusal.value)
        assert sentence.startswith(f"{path} is cut short") and sentence.endswith(": save or copy it again")
        assert "neither" not in sentence and sentence.count("cut short") == 1 and "(" not in sentence


@given(data=st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_anywhere_ends_in_a_sentence_or_an_image(tmp_path, data):
    """Flip or cut bytes of good files: InputFileError or a density, nothing else."""
    samples = np.random.default_rng(0).integers(1, 65535, (8, 8, 4))
    kind = data.draw(st.sampled_from(["gray16.png", "rgba16.png", "la16.png", "rgb8.png", "a.jpg", "a.npy"]))
    path = tmp_path / kind
    if kind == "a.jpg":
        Image.fromarray((samples[..., 0] // 256).astype(np.uint8)).save(path)
    elif kind == "a.npy":
        np.save(path, samples[..., 0] / 65535)
    else:
        color_type, bits = {"g": (0, 16), "l": (4, 16)}.get(kind[0], (6, 16) if "16" in kind else (2, 8))
        part = samples[..., : CHANNELS[color_type]]
        path.write_bytes(png_bytes(part if bits == 16 else part // 256, color_type, bits))
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        density = read_density(path, data.draw(st.booleans()))
    except InputFileError as error:
        assert str(path) in str(error)
    else:
        assert density.dtype == np.float32 and density.ndim == 2 and np.isfinite(density).all() and density.max() > 0


def turn_back(image: np.ndarray, orientation: int) -> np.ndarray:
    """How a picture that is seen as ``image`` is stored."""
    return {
        1: image,
        2: image[:, ::-1],
        3: image[::-1, ::-1],
        4: image[::-1],
        5: np.swapaxes(image, 0, 1),
        6: np.rot90(image, 1),
        7: np.rot90(image, 2).swapaxes(0, 1),
        8: np.rot90(image, -1),
    }[orientation]


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["gray 8", "gray 16", "color 8", "color 16", "jpeg"])
def test_photographs_are_read_the_right_way_up_whatever_their_kind(tmp_path, orientation, kind):
    seen = np.random.default_rng(0).integers(1, 200, (24, 40))
    seen = np.repeat(np.repeat(seen[::8, ::8], 8, axis=0), 8, axis=1)
    stored = np.ascontiguousarray(turn_back(seen, orientation))
    exif = Image.Exif()
    exif[0x0112] = orientation
    path = tmp_path / ("a.jpg" if kind == "jpeg" else "a.png")
    if kind == "gray 16":
        Image.fromarray((stored * 257).astype(np.uint16)).save(path, exif=exif)
    elif kind == "color 16":
        import zlib

        import png

        with path.open("wb") as file:
            rows = np.repeat(stored[..., None] * 257, 3, axis=2).reshape(len(stored), -1)
            png.Writer(stored.shape[1], stored.shape[0], bitdepth=16, greyscale=False).write(file, rows.tolist())
        # The chunk that Pillow writes, before the picture.
        data = exif.tobytes()[6:]
        chunk = len(data).to_bytes(4, "big") + b"eXIf" + data + zlib.crc32(b"eXIf" + data).to_bytes(4, "big")
        content = path.read_bytes()
        path.write_bytes(content[:33] + chunk + content[33:])
    else:
        picture = Image.fromarray(stored.astype(np.uint8))
        (picture.convert("RGB") if kind == "color 8" else picture).save(path, exif=exif, quality=95)
    read = read_density(path)
    assert read.shape == seen.shape
    np.testing.assert_allclose(read, seen / 255, atol=0.06 if kind == "jpeg" else 1e-6)
    assert read_color(path).shape == (*seen.shape, 3)


@pytest.mark.parametrize("kind", ["1", "L", "P", "RGBA", "I;16", "RGB;16", "npy", "exr"])
def test_more_pixels_than_a_solver_can_use_are_averaged_in_blocks(tmp_path, monkeypatch, kind):
    from esh.engine.files import image_files

    rng = np.random.default_rng(3)
    values = (rng.random((50, 83)) * 255).astype(np.uint8)
    path = tmp_path / {"npy": "a.npy", "exr": "a.exr"}.get(kind, "a.png")
    if kind == "npy":
        np.save(path, values / 255.0)
    elif kind == "exr":
        import OpenEXR

        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"Y": (values / 255.0).astype(np.float32)}).write(str(path))
    elif kind == "I;16":
        Image.fromarray(values.astype(np.uint16) * 257).save(path)
    elif kind == "RGB;16":
        import png

        with path.open("wb") as file:
            rows = np.repeat(values[..., None].astype(int) * 257, 3, axis=2).reshape(50, -1)
            png.Writer(83, 50, bitdepth=16, greyscale=False).write(file, rows.tolist())
    else:
        picture = Image.fromarray(values)
        picture = picture.convert("RGB") if kind == "RGBA" else picture
        if kind == "RGBA":
            picture.putalpha(Image.fromarray(values[::-1].copy()))
        (picture if kind == "RGBA" else picture.convert(kind)).save(path)
    whole = read_density(path).astype(np.float64)
    assert whole.shape == values.shape
    monkeypatch.setattr(image_files, "MOST_USED", 500)
    monkeypatch.setattr(image_files, "PIXELS_AT_ONCE", 900)
    # Blocks of 3 x 3 pixels; two columns are left for the last.
    expected = np.array([[whole[y : y + 3, x : x + 3].mean() for x in range(0, 83, 3)] for y in range(0, 50, 3)])
    np.testing.assert_allclose(read_density(path), expected, atol=1e-6)
    assert read_color(path).shape == (50, 83, 3)
    assert read_color(path, reduced=True).shape == (17, 28, 3)


def test_a_large_picture_takes_little_more_memory_than_its_bytes(tmp_path):
    import subprocess
    import sys

    # Two colors, 64 million pixels: 64 MB for Pillow, and 16 million numbers of 4 bytes.
    stripes = Image.new("1", (8000, 8000))
    stripes.paste(1, (0, 0, 4000, 8000))
    stripes.save(tmp_path / "large.png")
    script = f"""
import resource, numpy as np
from esh.engine.files.image_files import read_color, read_density
import PIL.Image, esh.engine.files.image_files
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
image = read_density({str(tmp_path / "large.png")!r})
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, *image.shape, float(image.mean()))
"""
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=120)
    grown, height, width, mean = finished.stdout.split()
    assert (height, width, mean) == ("4000", "4000", "0.5")
    if sys.platform == "linux":
        assert int(grown) < 420_000  # kB
