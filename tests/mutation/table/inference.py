"""The road from tracks to forces: corrections, the first frame, results of all frames."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/app/inference"

MUTANTS = [
    *mutants_of(
        "app/inference/correction/radii.py",
        f"{TESTS}/test_radii.py",
        ("radius=tracks.radius + found.correction", "radius=tracks.radius - found.correction"),
        ("radius=then.radius + found.correction", "radius=then.radius"),
        ("first is None or not has_radius_errors(", "first is None or has_radius_errors("),
        ("np.full(tracks.grain_count, found.radius_offset)", "np.full(tracks.grain_count, -found.radius_offset)"),
    ),
    *mutants_of(
        "app/inference/backward_pass.py",
        f"{TESTS}/test_backward_pass.py",
        ("information * variance[:, :1] + second[:, :1]", "variance[:, :1] + second[:, :1]"),
        ("(_load_ratio(sequence) / scale) ** alike", "(_load_ratio(sequence) * scale) ** alike"),
        ("return first / second if", "return second / first if"),
        ("np.sqrt((1.0 - weight) * own)", "np.sqrt((1.0 + weight) * own)"),
        ("* alike, sd**2 + drift)", "* alike, sd**2)"),
        (
            "(1.0 - weight) * np.column_stack([first.fn, first.ft]) + weight",
            "np.column_stack([first.fn, first.ft]) + weight",
        ),
    ),
    *mutants_of(
        "app/inference/first_frame.py",
        f"{TESTS}/test_first_frame.py",
        ("frames[1 : FRAMES + 1]", "frames[: FRAMES + 1]"),
        ("tracks.radius - (calibration.radius - calibration.radius_offset)", "tracks.radius"),
        ("position=tracks.position - own", "position=tracks.position + own"),
        ("- noise**2, 0.0)))\n", "- 4.0 * noise**2, 0.0)))\n"),
    ),
    *mutants_of(
        "app/inference/known_pairs.py",
        f"{TESTS}/test_known_pairs.py",
        ("tracks.position + rotate_offsets(", "tracks.position - rotate_offsets("),
        ("radius=tracks.radius + found.radius", "radius=tracks.radius - found.radius"),
        ("(frame.bearing_probability > BEARS) & (frame.fn > 0.0)", "frame.fn > 0.0"),
        ("forces.append(frame.fn[known])", "forces.append(frame.ft[known])"),
        ("np.full(contacts.count, frame, np.int32)", "np.full(contacts.count, 0, np.int32)"),
    ),
    *mutants_of(
        "app/inference/infer_sequence.py",
        (f"{TESTS}/test_measured_friction.py", f"{TESTS}/test_infer_sequence.py"),
        ("if check is None or check.agrees or assessed", "if check is None or assessed"),
        ("forces if k == 0 else frames[k]", "forces if k == 1 else frames[k]"),
        ("moved=forces.frame > 0", "moved=True"),
        ("penalise_friction(frames[k], check, measured=measured)", "frames[k]"),
        ("check.given, check.measured)", "check.measured, check.measured)"),
    ),
    *mutants_of(
        "app/inference/correction/friction.py",
        f"{TESTS}/test_measured_friction.py",
        ("np.clip(found.measured, *POSSIBLE)", "found.measured"),
        ("if found.enclosed and change < SAME_FRICTION:", "if found.enclosed:"),
        ("found.measured / material.friction - 1.0", "found.measured - material.friction"),
        ("np.argmax([quiet", "np.argmin([quiet"),
        (
            "lost[first - 1 : first + count + 1].mean() > TOLERATED_LOSS",
            "lost[first - 1 : first + count + 1].mean() > 1.0",
        ),
        ("calm & (lost <= TOLERATED_LOSS)", "calm"),
        ("wall_low=walls.low, wall_high=walls.high", "wall_low=walls.high, wall_high=walls.low"),
    ),
    *mutants_of(
        "app/inference/correction/softness.py",
        f"{TESTS}/test_softness.py",
        ("MAX_TRUST_MEASURED if seen else MAX_TRUST_STATED", "MAX_TRUST_MEASURED"),
        ("/ (2.0 * float(packing.grains.radius.mean()))", "/ float(packing.grains.radius.mean())"),
        ("compliance_sd=STIFFNESS_SD * overlap", "compliance_sd=STIFFNESS_SD"),
    ),
    *mutants_of(
        "app/inference/correction/soft_grain_errors.py",
        f"{TESTS}/test_soft_grain_errors.py",
        ("correct_grain_errors(sequence.tracks, measured", "correct_grain_errors(better.tracks, measured"),
        ("found.overlap * force > least", "found.overlap > least"),
        ("found.radius - found.radius.mean(), sd[2 * n :]", "found.radius - found.radius.mean(), sd[: 2 * n]"),
        ("min(sequence.settings.soft_trust, MAX_TRUST_CORRECTED)", "sequence.settings.soft_trust"),
    ),
    *mutants_of(
        "app/inference/correction/unseen.py",
        f"{TESTS}/test_unseen.py",
        ("tracks.id.max() + 1 + np.arange(u)", "np.arange(u)"),
        ("TrackStatus.INFERRED, TrackStatus.LOST", "TrackStatus.LOST, TrackStatus.INFERRED"),
        (">= tracks.grain_count)", "< tracks.grain_count)"),
        ("UnseenRodSettings(noise, sizes, overlap)", "UnseenRodSettings(noise, None, overlap)"),
    ),
]
