"""FMU for co-simulation (FMI 2.0): the model's C source behind the standard's functions, compiled.

Nothing but libm is needed where it runs, no Python either. The sources are in the archive, so that it can be compiled
for another platform.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from importlib import resources
from pathlib import Path
from xml.sax.saxutils import quoteattr

from indicial.conventions import COEFFICIENTS
from indicial.errors import InputError
from indicial.files import atomic_path
from indicial.rom.export.c_source import c_texts
from indicial.rom.export.portable import MEANING, Portable
from indicial.rom.state_space import StateSpaceModel

MODEL = "indicial_model"
"""Model identifier, and name of its sources."""

_FOLDERS = {"linux": ("linux64", ".so"), "darwin": ("darwin64", ".dylib")}


def export_fmu(model: StateSpaceModel, path: Path, *, sources_only: bool = False) -> tuple[Path, ...]:
    """An FMU with inputs alpha, beta [rad], p, q, r [rad/s] (those of the model) and speed [m/s]; outputs CA to Cn.

    Parameters
    ----------
    sources_only : bool
        Leave compiling to whoever imports it.

    Raises
    ------
    InputError
        If there is no C compiler (``$CC``, cc, gcc, clang), the platform is none that is known how to compile for, or
        the model has no modal form.
    """
    portable = Portable.of(model)
    header, source = c_texts(portable, MODEL)
    sources = {f"{MODEL}.h": header, f"{MODEL}.c": source, "fmi2.c": _fmi2(portable)}
    digest = hashlib.sha256("".join(sources.values()).encode()).hexdigest()
    guid = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
    sources["fmi2.c"] = sources["fmi2.c"].replace("@guid@", guid)
    sources = {name: _own_names(text, digest[:16]) for name, text in sources.items()}
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", _description(portable, guid))
        archive.writestr("documentation/README.txt", "\n".join(portable.notes()) + "\n")
        for name, text in sources.items():
            archive.writestr(f"sources/{name}", text)
        if not sources_only:
            archive.writestr(*_compiled(sources))
    return (path,)


def _own_names(text: str, digest: str) -> str:
    """Functions under names of this model alone: a program may load many such libraries into one space of names."""
    for name in (MODEL, MODEL.upper()):
        text = re.sub(rf"\b{name}(?!\.)", f"{name}_{digest}", text)  # but for the names of files
    return text


def _fmi2(portable: Portable) -> str:
    text = resources.files("indicial.rom.export").joinpath("fmi2.c").read_text(encoding="utf-8")
    return text.replace("@start@", ", ".join(f"{value:.17g}" for value in portable.offsets)).replace(
        "@speed@", f"{portable.model.condition.speed:.17g}"
    )


def _compiled(sources: dict[str, str]) -> tuple[str, bytes]:
    """Name in the archive and bytes of the shared library."""
    compiler = os.environ.get("CC") or next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    known = sys.platform in _FOLDERS and platform.machine() in ("x86_64", "AMD64", "arm64")
    if compiler is None or not known:
        reason = (
            "there is no C compiler (CC, cc, gcc, clang)" if known else f"for {sys.platform} on {platform.machine()}"
        )
        raise InputError(f"an FMU cannot be compiled here ({reason}): export its sources only and compile it elsewhere")
    folder, suffix = _FOLDERS[sys.platform]
    with tempfile.TemporaryDirectory() as place:
        for name, text in sources.items():
            (Path(place) / name).write_text(text, encoding="utf-8")
        library = Path(place) / f"{MODEL}{suffix}"
        files = [name for name in sources if name.endswith(".c")]
        command = [*compiler.split(), "-std=c99", "-O2", "-shared", "-fPIC", "-o", str(library), *files, "-lm"]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
        if done.returncode:
            raise InputError(f"{compiler} could not compile the FMU: {done.stderr.strip()[:500]}")
        return f"binaries/{folder}/{library.name}", library.read_bytes()


def _description(portable: Portable, guid: str) -> str:
    """``modelDescription.xml``; value references count the inputs, then the speed, then the six coefficients."""
    model = portable.model
    signals: list[tuple[str, str, str, str, str | None]] = [
        (name, "input", portable.unit(name), MEANING[name], f"{offset:.17g}")
        for name, offset in zip(model.inputs, portable.offsets, strict=True)
    ]
    signals.append(("speed", "input", "m/s", "speed through the air", f"{model.condition.speed:.17g}"))
    signals += [(name, "output", "1", MEANING[name], None) for name in COEFFICIENTS]
    variables, outputs = [], []
    for i, (name, causality, unit, meaning, start) in enumerate(signals):
        initial = "" if start is None else f" start={quoteattr(start)}"
        variables.append(
            f'    <ScalarVariable name={quoteattr(name)} valueReference="{i}" description={quoteattr(meaning)} '
            f'causality="{causality}" variability="continuous"><Real unit={quoteattr(unit)}{initial}/></ScalarVariable>'
        )
        if causality == "output":
            outputs.append(f'      <Unknown index="{i + 1}"/>')
    units = {
        "rad": '<BaseUnit rad="1"/>',
        "rad/s": '<BaseUnit rad="1" s="-1"/>',
        "m/s": '<BaseUnit m="1" s="-1"/>',
        "1": "<BaseUnit/>",
    }
    defined = "\n".join(f"    <Unit name={quoteattr(name)}>{base}</Unit>" for name, base in units.items())
    listed, unknowns = "\n".join(variables), "\n".join(outputs)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{MODEL}" guid="{guid}"
    description={quoteattr(" ".join(portable.notes()))} generationTool="indicial">
  <CoSimulation modelIdentifier="{MODEL}" canHandleVariableCommunicationStepSize="true" canInterpolateInputs="true"
      canGetAndSetFMUstate="true">
    <SourceFiles><File name="{MODEL}.c"/><File name="fmi2.c"/></SourceFiles>
  </CoSimulation>
  <UnitDefinitions>
{defined}
  </UnitDefinitions>
  <ModelVariables>
{listed}
  </ModelVariables>
  <ModelStructure>
    <Outputs>
{unknowns}
    </Outputs>
    <InitialUnknowns>
{unknowns}
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
