"""Devices made of a file: what is on their output stands in it, whoever is alive."""

from pathlib import Path

from rig.drivers.virtual import VirtualDAQ


class FileDAQ(VirtualDAQ):
    """``output``: the file. It keeps what it was given last, as most converters do, and says otherwise."""

    def __init__(self, bench, seed=0):
        options = dict(bench.driver.options)
        self.output = Path(options.pop("output"))
        driver = bench.driver.model_copy(update={"options": options})
        super().__init__(bench.model_copy(update={"driver": driver}), seed)

    @property
    def capabilities(self):
        return super().capabilities.model_copy(update={"virtual": False, "safe_without_host": True})

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self._put_out(voltages[-1])

    def _stop(self):
        self._put_out(0.0)

    def _put_out(self, volts):
        part = self.output.with_suffix(".part")
        part.write_text(f"{volts}")
        part.replace(self.output)  # whole, for whoever looks at the same time


class HonestFileDAQ(FileDAQ):
    """The same, and does not claim what it does not keep."""

    @property
    def capabilities(self):
        return super().capabilities.model_copy(update={"safe_without_host": False})
