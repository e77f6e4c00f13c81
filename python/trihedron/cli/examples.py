"""Examples for every command's help: purpose and command line."""

EXAMPLES: dict[str, tuple[tuple[str, str], ...]] = {
    "": (
        ("two examples on a simulated sensor, with reports", "trihedron demo"),
        ("is this log fit for a calibration?", "trihedron check LOG"),
        ("calibrate, with a report", "trihedron calibrate LOG --latitude 50 -o cal.json --report cal.html"),
        ("what a command does, its options, examples", "trihedron COMMAND --help"),
    ),
    "demo": (("Into a folder of that name; the same effect every time:", "trihedron demo tour --seed 3"),),
    "plan": (
        ("Turns of 90° on a table against a wall that gives the angle to 0.1°:", "trihedron plan --turn-error 0.1"),
        ("With the noise of your own sensor:", "trihedron plan --gyro-noise 0.01 --accel-noise 200"),
    ),
    "ports": (("What is plugged in, and what it might be:", "trihedron ports"),),
    "capture": (
        ("A serial board, for ten minutes:", "trihedron capture /dev/ttyUSB0 -o log.csv --seconds 600"),
        ("Led through a calibration:", "trihedron capture /dev/ttyUSB0 -o log.csv --guide --calibration cal.json"),
    ),
    "guide": (("What the guide would have said:", "trihedron guide log.csv"),),
    "report": (
        ("A page of a result that was saved with --json:", "trihedron report result.json --report result.html"),
    ),
    "check": (("Before anything else:", "trihedron check log.csv"),),
    "segment": (
        ("The table of poses and the signals with them shaded:", "trihedron segment log.csv --report poses.html"),
    ),
    "calibrate": (
        ("Everything detected; gravity from the latitude:", "trihedron calibrate log.csv --latitude 50.1 -o cal.json"),
        (
            "Six faces of a square case, turns of 90° between:",
            "trihedron calibrate log.csv --method faces --turns 90,-90",
        ),
        (
            "On a turntable at 90°/s, the unit taken to another pose between turns:",
            "trihedron calibrate log.csv --turntable 90 --turntable-error 0.1",
        ),
    ),
    "kalman": (
        ("With the noise of a static log:", "trihedron kalman log.csv --noise static.csv --report kalman.html"),
        (
            "Poses of a dividing head, its angles with 0.01° uncertainty:",
            "trihedron kalman log.csv --reference poses.csv --angle-sigma 0.01",
        ),
    ),
    "noise": (
        (
            "N and K beside a tracker's attitudes and a static log:",
            "trihedron noise flight.csv --static static.csv --reference truth.csv --report noise.html",
        ),
        (
            "Written for a filter:",
            "trihedron noise flight.csv --static static.csv --reference truth.csv --to kalibr -o imu.yaml",
        ),
    ),
    "allan": (
        ("The terms, the curves and Kalibr's imu.yaml:", "trihedron allan static.csv --report noise.html"),
        (
            "Counts of a known size:",
            'trihedron allan static.npz --rate 100 --gyro-lsb "0.05 deg/s" --accel-lsb "3.33 mg"',
        ),
        ("A log larger than the memory:", "trihedron allan static.npy --stream --columns gx,gy,gz --rate 1000"),
    ),
    "verify": (
        ("Is the calibration still valid?", "trihedron verify cal.json today.csv"),
        ("Status 2 beyond 2 mg, for a script:", "trihedron verify cal.json today.csv --limit-mg 2"),
        ("Is the vendor's right? Which is best?", "trihedron verify today.csv cal.json camera.json imu-result.yaml"),
    ),
    "diagnose": (
        (
            "Which effects are missing from the linear model?",
            "trihedron diagnose log.csv --latitude 50.1 --report diagnosis.html",
        ),
        ("Which effects are the unit's own?", "trihedron diagnose mon.csv tue.csv wed.csv --latitude 50.1"),
        ("Is this still the sensor of last year?", "trihedron diagnose log.csv --calibration cal.json"),
        ("Why does my simulation not fit?", "trihedron diagnose log.csv --against sim.toml --improved better.toml"),
    ),
    "fleet": (
        (
            "Every log of a folder, a folder for each device; table and page in `results`:",
            "trihedron fleet logs -o results --latitude 50.1",
        ),
    ),
    "apply": (("To m/s² and rad/s:", "trihedron apply cal.json log.csv -o corrected.csv"),),
    "export": (
        ("Kalibr's imu.yaml:", "trihedron export cal.json --to kalibr --noise noise.json -o imu.yaml"),
        ("C code for the board:", "trihedron export cal.json --to c -o imu_calibration.h"),
        ("Parameters of a flight controller:", "trihedron export cal.json --to ardupilot -o imu.param"),
    ),
    "convert": (("Any log as a plain table:", "trihedron convert flight.ulg -o log.csv"),),
    "simulate": (
        ("What there is ready-made:", "trihedron simulate --list"),
        ("A log with its truth beside it:", "trihedron simulate hand-session -o log.csv --truth truth.json --seed 3"),
        ("The digital twin of a recording:", "trihedron simulate --like log.csv --calibration cal.json -o copy.csv"),
    ),
}
