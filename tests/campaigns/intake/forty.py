"""Forty files as instruments and programs write them by their manuals: read right unaided, or asked for where nothing says what a
channel is; never wrong without a word.

python -m tests.campaigns.intake.forty
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused
from commissioner.recordings.importers import read_running
from commissioner.recordings.reading.mapping import ChannelMap, Target
from commissioner.records import RunningRecording

RATE_HZ, ROWS = 5000.0, 600
MOTOR = "motor_2kw2"
"""Whose plate is given beside each file, as `--motor`."""
T = np.arange(ROWS) / RATE_HZ
A = 2 * np.pi / 3
AMPS = [7.3 * np.cos(2 * np.pi * 50 * T - k * A - 0.6) + 0.11 * np.cos(2 * np.pi * 250 * T + k * A) for k in range(3)]
V = [565.7 * np.cos(2 * np.pi * 50 * T - k * A + np.pi / 6) for k in range(3)]
U = [326.6 * np.cos(2 * np.pi * 50 * T - k * A) for k in range(3)]
SIX = [*AMPS, *V]
SCALE = {"A": 1.0, "mA": 1e3, "V": 1.0, "kV": 1e-3, "mV": 1e3, "s": 1.0, "ms": 1e3, "us": 1e6}
AV = ("A", "A", "A", "V", "V", "V")
LABELS = ("Ia", "Ib", "Ic", "Vab", "Vbc", "Vca")


def rows(cells, sep=",", form="%.6g", comma=False, end="", first="", quote=False) -> str:
    """Rows of numbers, or of texts where a column holds them."""
    out = []
    for row in zip(*cells, strict=True):
        texts = [c if isinstance(c, str) else form % c for c in row]
        texts = [c.replace(".", ",") for c in texts] if comma else texts
        texts = [f'"{c}"' for c in texts] if quote else texts
        out.append(first + sep.join(texts) + end)
    return "\n".join(out) + "\n"


def units(values, names):
    return [x * SCALE[u] for x, u in zip(values, names, strict=True)]


@dataclass(frozen=True)
class Made:
    """A file; `asks`: nothing in it says what the channels are, by `channels` in their order; `volts`: of which kind."""

    data: bytes
    ending: str = ".csv"
    channels: tuple[str, ...] = ()
    volts: str = "line"


FILES: dict[str, Callable[[], Made]] = {}


def file(name: str):
    def keep(make: Callable[[], Made]) -> Callable[[], Made]:
        FILES[name] = make
        return make

    return keep


def text(body: str, encoding: str = "utf-8", **more) -> Made:
    return Made(body.encode(encoding), **more)


TEK = (
    "Model,MSO46\nFirmware Version,1.26.5\n\nWaveform Type,ANALOG,ANALOG,ANALOG,ANALOG,ANALOG,ANALOG\nPoint Format,Y,Y,Y,Y,Y,Y\n"
    "Horizontal Units,s\nHorizontal Scale,0.012\nHorizontal Delay,0.06\nSample Interval,0.0002\nRecord Length,600\n"
    "Gating,0.0% to 100.0%\nProbe Attenuation,10,10,10,200,200,200\nVertical Units,A,A,A,V,V,V\nVertical Offset,0,0,0,0,0,0\n"
    "Vertical Scale,2,2,2,200,200,200\nVertical Position,0,0,0,0,0,0\n"
)
FROM_TRIGGER = T - 0.06


@file("tektronix_mso_labels")
def _tek_labels() -> Made:
    return text(TEK + "Label,Ia,Ib,Ic,Vab,Vbc,Vca\nTIME,CH1,CH2,CH3,CH4,CH5,CH6\n" + rows([FROM_TRIGGER, *SIX]))


@file("tektronix_mso_bare")
def _tek_bare() -> Made:
    channels = tuple(f"CH{k}" for k in range(1, 7))
    return text(TEK + "Label,,,,,,\nTIME,CH1,CH2,CH3,CH4,CH5,CH6\n" + rows([FROM_TRIGGER, *SIX]), channels=channels)


@file("tektronix_dpo_probe_ma")
def _tek_ma() -> Made:
    said = ("mA", "mA", "mA", "V", "V", "V")
    head = TEK.replace("Vertical Units,A,A,A", "Vertical Units,mA,mA,mA")
    return text(
        head
        + "Label,i_u,i_v,i_w,u_uv,u_vw,u_wu\nTIME,CH1,CH2,CH3,CH4,CH5,CH6\n"
        + rows([FROM_TRIGGER, *units(SIX, said)])
    )


@file("keysight_infiniivision_bare")
def _key_bare() -> Made:
    head = "x-axis,1,2,3,4,5,6\nsecond,Ampere,Ampere,Ampere,Volt,Volt,Volt\n"
    return text(head + rows([FROM_TRIGGER, *SIX], form="%+.6E"), channels=("1", "2", "3", "4", "5", "6"))


@file("keysight_infiniivision_labels")
def _key_labels() -> Made:
    head = "x-axis,IA,IB,IC,VAB,VBC,VCA\nsecond,Ampere,Ampere,Ampere,Volt,Volt,Volt\n"
    return text(head + rows([FROM_TRIGGER, *SIX], form="%+.6E"))


@file("keysight_benchvue")
def _benchvue() -> Made:
    stamps = [f"2024-03-05 10:11:{12 + x:07.4f}" for x in T]
    head = "Instrument,DAQM909A\nStart time,2024-03-05 10:11:12\n\nScan Number,Time,Ia (A),Ib (A),Ic (A),Vab (V),Vbc (V),Vca (V)\n"
    return text(head + rows([[str(k) for k in range(1, ROWS + 1)], stamps, *SIX]))


@file("rohde_schwarz_rtb_bare")
def _rtb() -> Made:
    channels = tuple(f"C{k}" for k in range(1, 7))
    head = "in s,C1 in A,C2 in A,C3 in A,C4 in V,C5 in V,C6 in V\n"
    return text(head + rows([FROM_TRIGGER, *SIX], form="%.6E"), channels=channels)


@file("rohde_schwarz_mxo_labels")
def _mxo() -> Made:
    head = "Time in s,Ia in A,Ib in A,Ic in A,Vab in V,Vbc in V,Vca in V\n"
    return text(head + rows([FROM_TRIGGER, *SIX], form="%.6E"))


@file("rohde_schwarz_rth")
def _rth() -> Made:
    head = (
        "Model;RTH1004\nSerialNumber;1317.5000K04/100001\nFirmware Version;'1.80.3.10'\nAcquisition Time Stamp;2024-03-05_10:11:12\n"
        "Horizontal Scale;1.2E-02\nSample Interval;2.0E-04\nRecord Length;600\n\nTime [s];I_u [A];I_v [A];I_w [A];U_uv [V];U_vw [V];U_wu [V]\n"
    )
    return text(head + rows([FROM_TRIGGER, *SIX], sep=";"))


@file("lecroy_mda")
def _lecroy() -> Made:
    head = (
        "LECROYMDA810A,51234,Waveform\nSegments,1,SegmentSize,600\nSegment,TrigTime,TimeSinceSegment1\n#1,05-Mar-2024 10:11:12,0\n"
        "Time,Ia,Ib,Ic,Vab,Vbc,Vca\n"
    )
    return text(head + rows([FROM_TRIGGER, *SIX], form="%.8g"))


@file("rigol_ds_bare")
def _rigol() -> Made:
    count = [str(k) for k in range(ROWS)]
    head = "X,CH1,CH2,CH3,CH4,CH5,CH6,Start,Increment\nSequence,A,A,A,V,V,V,-6.000000e-02,2.000000e-04\n"
    return text(head + rows([count, *SIX], form="%.4e", end=",,"), channels=tuple(f"CH{k}" for k in range(1, 7)))


@file("rigol_dho_labels")
def _dho() -> Made:
    head = "Time(s),Ia(A),Ib(A),Ic(A),Vab(V),Vbc(V),Vca(V),\n"
    return text(head + rows([FROM_TRIGGER, *SIX], end=","))


SIGLENT = (
    "Record Length,Analog:600\nSample Interval,2.0000E-04\nVertical Units,CH1:A,CH2:A,CH3:A,CH4:V,CH5:V,CH6:V\n"
    "Vertical Scale,CH1:2.00,CH2:2.00,CH3:2.00,CH4:200.00,CH5:200.00,CH6:200.00\nVertical Offset,CH1:0.0,CH2:0.0,CH3:0.0,CH4:0.0,CH5:0.0,CH6:0.0\n"
    "Horizontal Units,S\nHorizontal Scale,1.20E-02\nModel Number,SDS6208L\nSerial Number,SDS6ABCD1R0001\nSoftware Version,1.4.1.0\n"
)


@file("siglent_bare")
def _siglent() -> Made:
    head = SIGLENT + "Source,CH1,CH2,CH3,CH4,CH5,CH6\nSecond,Ampere,Ampere,Ampere,Volt,Volt,Volt\n"
    return text(head + rows([FROM_TRIGGER, *SIX]), channels=tuple(f"CH{k}" for k in range(1, 7)))


@file("siglent_labels")
def _siglent_labels() -> Made:
    head = SIGLENT + "Source,Ia,Ib,Ic,Vab,Vbc,Vca\nSecond,Ampere,Ampere,Ampere,Volt,Volt,Volt\n"
    return text(head + rows([FROM_TRIGGER, *SIX]))


@file("picoscope_mixed_units")
def _pico() -> Made:
    said = ("mA", "A", "A", "V", "kV", "V")
    head = "Time,Ia,Ib,Ic,Vab,Vbc,Vca\n(ms),(mA),(A),(A),(V),(kV),(V)\n\n"
    return text(head + rows([1e3 * FROM_TRIGGER, *units(SIX, said)], form="%.8f"))


@file("picoscope_german")
def _pico_german() -> Made:
    head = (
        "Zeit;Strom L1;Strom L2;Strom L3;Spannung L1-L2;Spannung L2-L3;Spannung L3-L1\n(ms);(A);(A);(A);(V);(V);(V)\n\n"
    )
    return text(head + rows([1e3 * FROM_TRIGGER, *SIX], sep=";", comma=True, form="%.6f"))


@file("picolog")
def _picolog() -> Made:
    head = '"Time (s)","Ia Last (A)","Ib Last (A)","Ic Last (A)","Vab Last (V)","Vbc Last (V)","Vca Last (V)"\n'
    return text(head + rows([T, *SIX], quote=True))


YOKOGAWA = (
    '"Model","DL950"\n"BlockNumber",1\n"TraceName","Ia","Ib","Ic","Vab","Vbc","Vca"\n"BlockSize",600,600,600,600,600,600\n'
    '"VUnit","A","A","A","V","V","V"\n"SampleRate",5000,5000,5000,5000,5000,5000\n"HResolution",2.0E-04,2.0E-04,2.0E-04,2.0E-04,2.0E-04,2.0E-04\n'
    '"HUnit","s","s","s","s","s","s"\n"HOffset",0,0,0,0,0,0\n"Date","2024/03/05","2024/03/05","2024/03/05","2024/03/05","2024/03/05","2024/03/05"\n'
    '"Time","10:11:12.000","10:11:12.000","10:11:12.000","10:11:12.000","10:11:12.000","10:11:12.000"\n\n'
)


@file("yokogawa_dl_no_time")
def _yokogawa() -> Made:
    return text(YOKOGAWA + rows(SIX, first=",", form="%.7E"))


@file("yokogawa_wt_waveform")
def _wt() -> Made:
    head = (
        '"Model","WT5000"\n"Sample Rate","5 kS/s"\n"No.","Time[s]","I1[A]","I2[A]","I3[A]","U12[V]","U23[V]","U31[V]"\n'
    )
    return text(head + rows([[str(k) for k in range(ROWS)], T, *SIX]))


@file("fluke_norma")
def _norma() -> Made:
    head = "Fluke Norma 6000;Rev 2.1\nStart;05.03.2024 10:11:12\n\nTime[s];I1[A];I2[A];I3[A];U12[V];U23[V];U31[V]\n"
    return text(head + rows([T, *SIX], sep=";", comma=True))


@file("fluke_scopemeter_phase_volts")
def _fluke() -> Made:
    head = '"FlukeView ScopeMeter"\n"Instrument","Fluke 190-504"\n"Time (ms)","I L1 (A)","I L2 (A)","I L3 (A)","U L1-N (V)","U L2-N (V)","U L3-N (V)"\n'
    return text(head + rows([1e3 * T, *AMPS, *U]), volts="phase")


@file("dewesoft")
def _dewesoft() -> Made:
    head = (
        "Data header\nStart time:\t3/5/2024 10:11:12.000\nSample rate:\t5000\nNumber of channels:\t6\n\n"
        "Time (s)\tI1 (A)\tI2 (A)\tI3 (A)\tU12 (V)\tU23 (V)\tU31 (V)\n"
    )
    return text(head + rows([T, *SIX], sep="\t"))


@file("hbm_perception")
def _perception() -> Made:
    head = "Time;I_A;I_B;I_C;U_AB;U_BC;U_CA\ns;A;A;A;V;V;V\n"
    return text(head + rows([T, *SIX], sep=";", comma=True))


@file("hbm_catman")
def _catman() -> Made:
    head = (
        "DEWETRON catman ASCII\nTime  1 - default sample rate [s]\tStrom U [A]\tStrom V [A]\tStrom W [A]\tSpannung U-V [V]\tSpannung V-W [V]"
        "\tSpannung W-U [V]\n"
    )
    return text(head + rows([T, *SIX], sep="\t", comma=True), encoding="cp1252")


@file("siemens_starter")
def _starter() -> Made:
    names = [f"r0069[{k}] Phase current actual value, Phase {p} [A]" for k, p in enumerate("UVW")]
    names += [f"r0089[{k}] Actual phase voltage, Phase {p} [V]" for k, p in enumerate("UVW")]
    head = ";".join(["Time [ms]", *names]) + "\n"
    return text(head + rows([1e3 * T, *AMPS, *U], sep=";"), volts="phase")


@file("abb_drive_composer")
def _abb() -> Made:
    names = [f"Current {p} [A]" for p in "UVW"] + [f"Voltage {p} [V]" for p in ("UV", "VW", "WU")]
    head = "Drive Composer pro\nMonitor started;2024-03-05 10:11:12\n" + ";".join(["Time [s]", *names]) + "\n"
    return text(head + rows([T, *SIX], sep=";"))


@file("schneider_somove")
def _somove() -> Made:
    head = "sep=;\nTime (ms);Motor current phase U (A);Motor current phase V (A);Motor current phase W (A);Voltage UV (V);Voltage VW (V);Voltage WU (V)\n"
    return text(head + rows([1e3 * T, *SIX], sep=";"))


@file("labview_lvm")
def _lvm() -> Made:
    six = "\t".join
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\n"
        "Time_Pref\tRelative\nDate\t2024/03/05\nTime\t10:11:12.123\n***End_of_Header***\t\n\nChannels\t6\nSamples\t" + six(["600"] * 6)
        + "\nDate\t" + six(["2024/03/05"] * 6) + "\nTime\t" + six(["10:11:12.123"] * 6) + "\nY_Unit_Label\tA\tA\tA\tV\tV\tV\nX_Dimension\t"
        + six(["Time"] * 6) + "\nX0\t" + six(["0.0E+0"] * 6) + "\nDelta_X\t" + six(["2.0E-4"] * 6)
        + "\n***End_of_Header***\t\nX_Value\tIa\tIb\tIc\tVab\tVbc\tVca\tComment\n"
    )  # fmt: skip
    return text(head + rows([T, *SIX], sep="\t", end="\t"), ending=".lvm")


@file("flexlogger")
def _flexlogger() -> Made:
    head = "Name,motor test\nSample Rate (Hz),5000\n\nRelative Time (s),Ia (A),Ib (A),Ic (A),Vab (V),Vbc (V),Vca (V)\n"
    return text(head + rows([T, *SIX]))


@file("hioki")
def _hioki() -> Made:
    head = '"HIOKI MR8847","V 2.10"\n"Trigger Time","24-03-05 10:11:12"\n"Time","Ia[A]","Ib[A]","Ic[A]","Vab[V]","Vbc[V]","Vca[V]"\n'
    return text(head + rows([T, *SIX], form="%+.5E"))


@file("hantek_bare")
def _hantek() -> Made:
    head = "nr,time,ch1,ch2,ch3,ch4,ch5,ch6\n"
    return text(head + rows([[str(k) for k in range(ROWS)], T, *SIX]), channels=tuple(f"ch{k}" for k in range(1, 7)))


@file("pandas_index")
def _pandas() -> Made:
    return text(",time,ia,ib,ic,vab,vbc,vca\n" + rows([[str(k) for k in range(ROWS)], T, *SIX], form="%.17g"))


@file("r_write_csv")
def _r() -> Made:
    names = '"","time","i_a","i_b","i_c","v_ab","v_bc","v_ca"\n'
    return text(names + rows([[f'"{k}"' for k in range(1, ROWS + 1)], T, *SIX], form="%.15g"))


@file("ltspice")
def _ltspice() -> Made:
    return text(
        "time\tI(a)\tI(b)\tI(c)\tV(a,b)\tV(b,c)\tV(c,a)\n" + rows([T, *SIX], sep="\t", form="%.15e"), ending=".txt"
    )


@file("french")
def _french() -> Made:
    head = "Temps (s);Courant phase 1 (A);Courant phase 2 (A);Courant phase 3 (A);Tension U12 (V);Tension U23 (V);Tension U31 (V)\n"
    return text(head + rows([T, *SIX], sep=";", comma=True), encoding="cp1252")


@file("spanish")
def _spanish() -> Made:
    head = "Tiempo (ms);Corriente fase A (A);Corriente fase B (A);Corriente fase C (A);Tensión AB (V);Tensión BC (V);Tensión CA (V)\n"
    return text(head + rows([1e3 * T, *SIX], sep=";", comma=True), encoding="latin-1")


@file("italian")
def _italian() -> Made:
    head = "Tempo [s];Corrente fase R [A];Corrente fase S [A];Corrente fase T [A];Tensione RS [V];Tensione ST [V];Tensione TR [V]\n"
    return text(head + rows([T, *SIX], sep=";", comma=True))


@file("chinese_gbk")
def _chinese() -> Made:
    head = "时间(ms),A相电流(A),B相电流(A),C相电流(A),AB线电压(V),BC线电压(V),CA线电压(V)\n"
    return text(head + rows([1e3 * T, *SIX]), encoding="gbk")


@file("two_wattmeters")
def _wattmeters() -> Made:
    return text("t [s],i_a [A],i_c [A],v_ab [V],v_cb [V]\n" + rows([T, AMPS[0], AMPS[2], V[0], -V[1]]))


@file("excel_unicode_footer")
def _excel() -> Made:
    head = "Time / us\tI1 / mA\tI2 / mA\tI3 / mA\tU12 / V\tU23 / V\tU31 / V\n"
    said = ("mA", "mA", "mA", "V", "V", "V")
    return text(
        head + rows([1e6 * T, *units(SIX, said)], sep="\t") + "\nEnd of data\n", encoding="utf-16", ending=".txt"
    )


TARGETS = ("current_u_a", "current_v_a", "current_w_a", "voltage_uv_v", "voltage_vw_v", "voltage_wu_v")


def verdict(name: str, folder: Path) -> str:
    """`right`, `asked` (and right once told), or what is wrong."""
    made = FILES[name]()
    path = folder / f"{name}{made.ending}"
    path.write_bytes(made.data)
    try:
        seen = read_running(path, motor=MOTOR)
    except DataRefused as refusal:
        if not made.channels:
            return f"refused: {refusal.what.replace(str(path), name)} [{refusal.value}]"
        if "--map" not in refusal.remedy:
            return f"refused without a way to tell: {refusal.what.replace(str(path), name)}"
        told = ChannelMap({c: Target(t) for c, t in zip(made.channels, TARGETS, strict=True)})
        try:
            wrong = _off(read_running(path, told, MOTOR), made)
        except DataRefused as second:
            return f"refused though told: {second.what.replace(str(path), name)} [{second.value}]"
        return "asked" if not wrong else f"WRONG once told: {wrong}"
    wrong = _off(seen, made)
    return "right" if not wrong else f"WRONG: {wrong}"


def _off(seen: RunningRecording, made: Made) -> str:
    """What differs from the truth; nothing where all is right."""
    volts = V if made.volts == "line" else U
    if seen.voltages_are_line_to_line is not (made.volts == "line"):
        return "line and phase voltages"
    if seen.time_s.size != ROWS:
        return f"{seen.time_s.size} rows"
    if not np.allclose(np.diff(seen.time_s), 1 / RATE_HZ, rtol=2e-2) or abs(seen.sample_period_s * RATE_HZ - 1) > 1e-3:
        return f"sample period {seen.sample_period_s}"
    for kind, truth, got in (("current", AMPS, seen.currents_a), ("voltage", volts, seen.voltages_v)):
        for k in range(3):
            if np.isfinite(got[k]).all() and not np.allclose(got[k], truth[k], atol=0.01 * np.max(np.abs(truth[k]))):
                return f"{kind} {k}"
        if sum(np.isfinite(x).all() for x in got) < 2:
            return f"{kind}s missing"
    return ""


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        seen = {name: verdict(name, Path(folder)) for name in FILES}
    for name, said in seen.items():
        if said not in ("right", "asked"):
            print(f"{name}: {said}")
    right, asked = (sum(said == word for said in seen.values()) for word in ("right", "asked"))
    wrong = sum(said.startswith("WRONG") for said in seen.values())
    print(
        f"of {len(seen)} files {right} read right unaided, {asked} asked what their channels are; {wrong} wrong in silence"
    )


if __name__ == "__main__":
    main()
