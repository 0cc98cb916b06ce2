"""Records of a short plan as a C header, for the fuzzer of the loop (checks/fuzz_loop.h): records.py > DIR/records.h."""

from captures import tick_of

from rig.tick.layout import TickArrays


def header() -> str:
    """Return the bytes of each array of a plan whose harmonics are controlled, by place, and its waveforms' period."""
    arrays = tick_of("harmonics").arrays
    lines = [f"enum {{ RECORDS_PERIOD = {arrays.waveforms.shape[1]} }};"]
    names = TickArrays._fields[:16]
    for name in names:
        data = ",".join(map(str, getattr(arrays, name).tobytes()))
        lines.append(f"static const uint8_t record_of_{name}[] = {{{data}}};")
    table = ", ".join(f"{{record_of_{name}, sizeof record_of_{name}}}" for name in names)
    lines.append(f"static const struct {{ const uint8_t *bytes; uint32_t n; }} records[] = {{{table}}};")
    return "\n".join(lines)


if __name__ == "__main__":
    print(header())
