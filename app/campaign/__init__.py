"""Many experiments: a table of experiments and settings, run one by one on processes or a cluster, told as one."""
