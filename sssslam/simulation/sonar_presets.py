"""Sonars by name; each number with where it comes from.

Levels are typical of the class, not of one product. Noise is thermal noise (Mellen 1952: -15 + 20 log10 f[kHz] dB re
1 uPa^2/Hz) in the band of the range resolution, less the array's directivity, plus 3 dB for the receiver; at 100 kHz
the sea's own noise adds 2 dB, at 900 kHz the compression of a chirp takes 10 dB off. Ping rates let the last echo come
back before the next ping.
"""

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    # EdgeTech 4200 and Klein 3900 class, high band: 0.3 to 0.5 deg by 50 deg, 75 to 150 m, 2 to 3 cm, fan 10 to 25 deg
    # down (makers' sheets). 0.5 m at 400 kHz is 0.38 deg.
    "400kHz": {
        "frequency": 400e3,
        "array_length": 0.5,
        "source_level": 210.0,
        "noise_level": 50.0,
        "vertical_beamwidth_deg": 50.0,
        "depression_deg": 20.0,
        "range_max": 75.0,
        "sample_spacing": 0.05,
        "ping_rate": 6.7,
        "ray_step": 0.05,
    },
    # Low band of the same: 0.8 to 1.3 deg, 150 to 500 m, 6 to 8 cm. 1 m at 100 kHz is 0.76 deg.
    "100kHz": {
        "frequency": 100e3,
        "array_length": 1.0,
        "source_level": 220.0,
        "noise_level": 40.0,
        "vertical_beamwidth_deg": 50.0,
        "depression_deg": 20.0,
        "range_max": 200.0,
        "sample_spacing": 0.08,
        "ping_rate": 3.0,
        "ray_step": 0.1,
    },
    # Klein 3900 (445/900 kHz, USGS Data Series 739) and EdgeTech 2205 class: 0.2 to 0.25 deg, 25 to 50 m, 1 to 1.5 cm.
    # 0.45 m at 900 kHz is 0.19 deg.
    "900kHz": {
        "frequency": 900e3,
        "array_length": 0.45,
        "source_level": 205.0,
        "noise_level": 48.0,
        "vertical_beamwidth_deg": 50.0,
        "depression_deg": 20.0,
        "range_max": 40.0,
        "sample_spacing": 0.0125,
        "ping_rate": 12.0,
        "ray_step": 0.025,
    },
    # Humminbird side imaging: transducer of 0.108 m (PyHum's default), 1.55 deg at 455 kHz; fan about 55 deg at -3 dB,
    # which the maker quotes as 86 deg at -10 dB; 15 to 40 m, 2 to 6 cm; 23 pings a second in PyHum's test recording.
    "humminbird-455": {
        "frequency": 455e3,
        "array_length": 0.108,
        "source_level": 205.0,
        "noise_level": 58.0,
        "vertical_beamwidth_deg": 55.0,
        "depression_deg": 30.0,
        "range_max": 30.0,
        "sample_spacing": 0.02,
        "ping_rate": 20.0,
        "ray_step": 0.04,
    },
}
