"""The C header of the tick: every record from its numpy dtype, with assertions of sizes and offsets, and how it is called."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rig.firmware.signature import Arguments

SCALARS = {
    "f8": "double",
    "f4": "float",
    "i8": "int64_t",
    "i2": "int16_t",
    "u4": "uint32_t",
    "u2": "uint16_t",
    "u1": "uint8_t",
    "c16": "struct tick_complex",
    "c8": "struct tick_complex_float",
}
"""Types of C by those of numpy."""
COMPLEX = """\
struct tick_complex { double re, im; };
struct tick_complex_float { float re, im; };
"""
SYMBOL = "vibrolock_tick_block"
DIGEST = "vibrolock_tick_digest"


@dataclass
class _Records:
    """Declarations of records, inner ones before those that hold them."""

    text: list[str] = field(default_factory=list)

    def add(self, name: str, dtype: np.dtype) -> str:
        """Declare a record with all that it holds; return its type in C."""
        if dtype.names is None:
            return SCALARS[dtype.str[1:]]
        fields: list[str] = []
        checks: list[str] = []
        for one in dtype.names:
            kind, offset = dtype.fields[one][:2]  # type: ignore[index]  # it has names
            shape = "".join(f"[{n}]" for n in kind.shape)
            fields.append(f"    {self.add(f'{name}_{one}', kind.base)} {one}{shape};")
            checks.append(f"TICK_AT({name}, {one}, {offset});")
        size = f"TICK_SIZE({name}, {dtype.itemsize});"
        self.text += [f"struct {name} {{", *fields, "};", size, *checks, ""]
        return f"struct {name}"


def _counts(name: str, array: np.ndarray) -> list[str]:
    """Names of what holds the lengths of an array of the bundle."""
    return [f"n_{name}", f"{name}_length"][: array.ndim]


class _Run(NamedTuple):
    """Numbers of double precision that lie in a row in a record, and again, ``times`` in all, every ``stride`` bytes."""

    at: int
    numbers: int
    times: int = 1
    stride: int = 0


def _doubles(dtype: np.dtype, at: int = 0) -> list[_Run]:
    """Where a record from ``at`` on has numbers of double precision; a complex one is two."""
    base, count = dtype.base, int(np.prod(dtype.shape, dtype=int))
    if base.names is None:
        return [_Run(at, count * base.itemsize // 8)] if base.str[1:] in ("f8", "c16") else []
    out: list[_Run] = []
    for name in base.names:
        kind, offset = base.fields[name][:2]  # type: ignore[index]  # it has names
        for run in _doubles(kind, at + offset):
            if out and run.times == out[-1].times == 1 and out[-1].at + 8 * out[-1].numbers == run.at:
                out[-1] = out[-1]._replace(numbers=out[-1].numbers + run.numbers)
            else:
                out.append(run)
    return [run._replace(times=count, stride=base.itemsize) for run in out] if count > 1 else out


def _listed(name: str, lines: list[str]) -> str:
    """A macro that does the same with every item of a list."""
    return " \\\n".join([f"#define {name}(DO)", *(f"    DO({line})" for line in lines)])


def _passed(address: str, size: int, lengths: list[str]) -> str:
    """How numba takes an array: two owners, number of items, bytes of one, address, lengths, steps in bytes."""
    steps = [" * ".join([f"(int64_t){size}", *lengths[axis + 1 :]]) for axis in range(len(lengths))]
    return ", ".join(["0", "0", " * ".join(lengths), str(size), address, *lengths, *steps])


def _parameters(types: Mapping[str, str], arrays: Mapping[str, np.ndarray]) -> str:
    """Declare parameters of the compiled function."""
    ones = ["void *", "void *", "int64_t", "int64_t"]
    all_ = [["void **", "void **"], *([*ones, f"{types[k]} *", *["int64_t"] * (2 * a.ndim)] for k, a in arrays.items())]
    return ",\n    ".join(", ".join(some) for some in all_)


def header(arguments: Arguments, digest: str) -> str:
    """Return the header's text for the records of these arguments, with the digest of the kernels."""
    records, arrays = _Records(), arguments.by_name()
    types = {name: records.add(f"tick_{name}", array.dtype) for name, array in arrays.items()}
    bundle: list[str] = []
    given: list[str] = []
    for name, array in arguments.t._asdict().items():
        lengths = _counts(name, array)
        bundle += [f"    {types[name]} *{name};", f"    int64_t {', '.join(lengths)};"]
        given.append(_passed(f"t->{name}", array.itemsize, [f"t->{one}" for one in lengths]))
    for name in arguments._fields[1:]:
        array = arrays[name]
        lengths = ["1"] if name == "continuation" else ["n", "n_channels"][: array.ndim]
        given.append(_passed(f"s->{name}", array.itemsize, lengths))
    samples = [f"    {types[name]} *{name};" for name in arguments._fields[1:]]
    types_of = {name: array.dtype for name, array in arguments.t._asdict().items()}
    doubles = [f"{name}, {', '.join(map(str, run))}" for name, one in types_of.items() for run in _doubles(one)]
    return _TEXT.format(
        digest=digest,
        complex=COMPLEX,
        records="\n".join(records.text),
        bundle="\n".join(bundle),
        arrays=_listed("TICK_ARRAYS", [f"{name}, {types[name]}" for name in arguments.t._fields]),
        doubles=_listed("TICK_DOUBLES", doubles),
        samples="\n".join(samples),
        parameters=_parameters(types, arrays),
        given=",\n        ".join(given),
        symbol=SYMBOL,
        told=DIGEST,
    )


_TEXT = """\
/* The compiled tick of vibrolock: its records and how it is called. Written by `rig firmware tick`; not to be edited.
 *
 * All arrays begin at addresses that are multiples of 8. The tick allocates nothing and keeps nothing: its state is in the
 * arrays. It needs the functions of libm and of the compiler that are named in the text beside the object. */

#ifndef VIBROLOCK_TICK_H
#define VIBROLOCK_TICK_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

#define VIBROLOCK_TICK_DIGEST "{digest}"
/* The digest in the object: that of the kernels and records from which it was made. Equal to the one above, or the header is of
 * another object. */
extern const char {told}[65];

#define TICK_SIZE(record, bytes) static_assert(sizeof(struct record) == (bytes), #record " has another size")
#define TICK_AT(record, field, bytes) \\
    static_assert(offsetof(struct record, field) == (bytes), #record "." #field " lies elsewhere")

{complex}
{records}
/* Settings and state of a run. `n_...`: records of an array; `waveforms` has `n_waveforms` rows of `waveforms_length`. */
struct tick_arrays {{
{bundle}
}};

/* The arrays in this order, with the type of an item: DO(name, type). */
{arrays}

/* Where their records have numbers of double precision, for whoever checks them: DO(name, bytes from the record's beginning,
 * how many there are in a row, how often such a row comes, and every how many bytes). */
{doubles}

/* A block of samples: volts [n][n_channels], the device's flags [n], what was put out instead [n] (V, else NaN); filled are
 * readings [n][n_channels], rows [n], outputs [n] (V), and how they go on (one record). */
struct tick_samples {{
{samples}
}};

int32_t {symbol}(
    {parameters});

/* Process n samples of n_channels. Returns 0; anything else is a fault of the compiled code. */
static inline int32_t vibrolock_tick(const struct tick_arrays *t, const struct tick_samples *s, int64_t n,
                                     int64_t n_channels) {{
    void *result = 0, *fault = 0;
    return {symbol}(&result, &fault,
        {given});
}}

#endif
"""
