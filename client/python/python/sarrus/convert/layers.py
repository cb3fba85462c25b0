"""Layers of a USD stage, which lie in folders that the user names."""

from pathlib import Path
from typing import Any

from sarrus.convert.urdf import check_file
from sarrus.errors import LoadError


def words(error: Exception) -> str:
    """The words of an error of USD, behind the place in its sources."""
    try:
        said = str(error)
    except UnicodeError:
        return "a text that is not UTF-8"
    return " ".join(said.split(" : ", 1)[-1].split()).strip("' ")


def checked_layers(pxr: Any, path: Path, include: list[Path]) -> list[Any]:
    """The layers that a file names, each only below the file's folder or an included one.

    Paths are USD's own, which it shortens as texts; links count where they lead.
    """
    allowed = [folder.resolve() for folder in (path.parent, *include)]
    todo, layers = [path], {}
    while todo:
        file = todo.pop()
        if file in layers:
            continue
        try:
            check_file(Path(pxr.Ar.SplitPackageRelativePathOuter(str(file))[0]))
            layers[file] = pxr.Sdf.Layer.FindOrOpen(str(file))
        except (pxr.Tf.ErrorException, OSError, ValueError) as error:
            raise LoadError(f"{file}: {words(error)}", []) from error
        if layers[file] is None:
            raise LoadError(f"{file}: no file of USD, or none that can be read", [])
        # a reference inside of the layer has no name
        for name in filter(None, layers[file].GetCompositionAssetDependencies()):
            inner = Path(layers[file].ComputeAbsolutePath(name))
            if not inner.is_absolute():
                raise LoadError(f"{file}: it names {name}, which is not there", [])
            outer = Path(pxr.Ar.SplitPackageRelativePathOuter(str(inner))[0]).resolve()
            if not any(outer.is_relative_to(folder) for folder in allowed):
                flag = f"--include-dir={outer.parent}"
                raise LoadError(f"{file}: it names {outer}, outside of its folder; {flag}", [])
            todo.append(inner)
    return list(layers.values())
