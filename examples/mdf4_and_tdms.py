"""A measurement as MDF4 and as TDMS, judged from the frames that asammdf and npTDMS make of it.

Run it with

    pip install '.[pandas]' asammdf npTDMS
    python examples/mdf4_and_tdms.py

Channels named otherwise than `<signal>_<unit>` get their names in the rig file's `[columns]`, or by `frame.rename`.
"""

import tempfile
from pathlib import Path

import asammdf
import nptdms
import numpy as np

import pitchleak as pl


def write_mdf4(channels: dict[str, np.ndarray], file: Path) -> None:
    """Pressures at every time and the rest in a group of its own, as loggers part fast channels from slow ones."""
    mdf = asammdf.MDF(version="4.10")
    time = channels["t_s"]
    for group in (["pa_bar", "pb_bar"], ["x_mm", "qa_lpm", "qb_lpm", "force_n"]):
        mdf.append([asammdf.Signal(channels[name], time, name=name) for name in group])
    mdf.save(file)


def write_tdms(channels: dict[str, np.ndarray], file: Path) -> None:
    """Waveforms: the time is where they begin and how far their samples are apart."""
    waveform = {"wf_start_offset": float(channels["t_s"][0]), "wf_increment": float(np.diff(channels["t_s"]).mean())}
    with nptdms.TdmsWriter(file) as writer:
        names = [name for name in channels if name != "t_s"]
        writer.write_segment([nptdms.ChannelObject("pitch", name, channels[name], waveform) for name in names])


def main() -> None:
    channels = dict(pl.simulate(13, leak_internal="0.5 L/min", noise="0.3 %", duration=20).columns)
    with tempfile.TemporaryDirectory() as folder:
        mdf4, tdms = Path(folder) / "pitch.mf4", Path(folder) / "pitch.tdms"
        write_mdf4(channels, mdf4)
        write_tdms(channels, tdms)
        with asammdf.MDF(mdf4) as file:
            # One time for all channels; `raster=0.01` where their groups were sampled at different ones.
            from_mdf4 = pl.replay(file.to_dataframe())
        # A group at a time: its frame has the channels' own names.
        from_tdms = pl.replay(nptdms.TdmsFile.read(tdms)["pitch"].as_dataframe(time_index=True))
    for name, found in {"MDF4": from_mdf4, "TDMS": from_tdms}.items():
        flow = found.leakage.internal
        print(f"{name}: {found.verdict.word}, internal {flow.mean_lpm:.3f} ± {1.96 * flow.std_lpm:.3f} L/min")
        assert found.verdict.faults == ("internal",)


if __name__ == "__main__":
    main()
