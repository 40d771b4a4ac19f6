"""Whether a folder, its results and its lock belong to this experiment, this code and this process."""

from tests.mutation.mutant import mutants_of

LOCK = "tests/app/process/test_lock.py"
STATE = "tests/app/cli/test_out_of_date.py"
FOLDER = ("tests/app/cli/test_run_folder_owner.py", "tests/app/cli/test_recording_state.py")
OTHER_CODE = "tests/app/cli/test_other_code.py"

MUTANTS = [
    *mutants_of(
        "app/process/machine/free_memory.py",
        "tests/app/process/test_free_memory.py",
        ("        _set(RETURNED)\n        release_free_memory()", "        release_free_memory()"),
        ("    _returning = True", "    _returning = False"),
    ),
    *mutants_of(
        "app/process/signals.py",
        "tests/app/cli/test_signals.py",
        ("frame.f_code.co_filename.startswith(LOCKING)", "False"),
        ("if self._count < WAITING:", "if True:"),
        ("attempt.try_again(unraisable.exc_value.number)", "pass"),
    ),
    *mutants_of(
        "app/process/lock.py",
        LOCK,
        ("if silence < LEASE:", "if silence < 0.0 * LEASE:"),
        ("if silence < LEASE:", "if True:"),
        ("os.utime(handle)", "pass"),
        ("return holder is not None and holder != this", "return False"),
        ("if not _is_taken(handle, this):", "if True:"),
        ("== (this.boot, this.container)", "== (this.boot, self.container)"),
        ("return _start_time(self.process) == self.began", 'return _start_time(self.process) != ""'),
        ('"" if fields[0] == "Z" else fields[19]', "fields[19]"),
        ("if not locked and holder is None:", "if False:"),
        ("if dead is not None:", "if False:"),
        ("            for each in made:\n                each.rmdir()", "            pass"),
        ("fcntl.LOCK_EX | fcntl.LOCK_NB", "fcntl.LOCK_SH | fcntl.LOCK_NB"),
        ("os.register_at_fork(after_in_child=_close_in_child)", "pass"),
    ),
    *mutants_of(
        "app/out_of_date.py",
        STATE,
        ("if now.get(key) != stored.get(key)", "if key in stored and now.get(key) != stored.get(key)"),
        ("if fingerprint(VerdictLog(folder / VERDICTS).snapshot()) != piece", "if False and piece"),
        ("and experiment.inputs.checksum(file) != listed[name]", "and False"),
        ("and now[name] != former.get(name)", "and now[name] == former.get(name)"),
        ("sorted(listed.keys() - now.keys())", "[]"),
        ("sorted(now.keys() - listed.keys())", "[]"),
        ("FORCES.alone) or piece", "FORCES.alone) and piece"),
        ("reasons = reasons or _changed_settings(owner.name, _settings_now(owner), settings)", "pass"),
        ("LISTED = 3", "LISTED = 30"),
    ),
    *mutants_of(
        "app/out_of_date.py",
        "tests/app/cli/test_recording_state.py",
        ("made_from is not None and made_from != results", "False"),
    ),
    *mutants_of(
        "app/run_folder.py",
        FOLDER,
        ("if owner is None or is_same_file(owner, experiment.file):", "if True:"),
        ("not isinstance(inputs, dict) or inputs == _inputs_of(experiment)", "True"),
        ("not isinstance(inputs, dict) or has_input(beside, inputs)", "True"),
        ("2 * alike >= len(sample) > 0", "alike > 0"),
        ('if _hash_of_file(file) == sums.get(file.name, ""):', "if False:"),
        ("        refuse_foreign_folder(run.folder, run.experiment)  # claimed meanwhile\n", ""),
        ("if file is None and has_input(Path(origin.experiment), origin.checksums):", "if file is None:"),
        ("        self.claim()\n", ""),
    ),
    *mutants_of(
        "app/run_folder.py",
        OTHER_CODE,
        ('if not stored or stored.get("made_from") == origin.fingerprint:', "if not stored:"),
        ('if stored["inputs"] != origin.inputs:', "if False:"),
        ('["other code"] if stored.get("code") != origin.code else []', "[]"),
        ("if former.get(library) != version:", "if False:"),
        ("        return self.keep_old\n", "        return True\n"),
        ("inputs = _hash_of([config, sums, self.frames.stored, verdicts])", "inputs = _hash_of([sums, verdicts])"),
    ),
]
