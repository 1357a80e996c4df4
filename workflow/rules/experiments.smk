# Questions that are no sweep: one experiment, one file; and how long things take.


rule experiment:
    input:
        not_stale,
    output:
        "results/{study}/experiments/{experiment}.h5",
    log:
        "results/{study}/logs/experiment/{experiment}.log",
    benchmark:
        "results/{study}/benchmarks/experiment/{experiment}.tsv"
    priority: 20
    conda:
        "../envs/stiffdice.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(30),
    params:
        planned=sealed("experiment"),
        asked=asked_of("experiment", "{experiment}"),
    script:
        "../scripts/measure.py"


# Alone on the machine: it takes every core that the workflow has, though it uses one. On a cluster it asks for one, and
# the profile for a node of its own.
use rule experiment as timing with:
    output:
        "results/{study}/benchmarks/timings/{timing}.h5",
    log:
        "results/{study}/logs/timings/{timing}.log",
    benchmark:
        "results/{study}/benchmarks/timings/{timing}.tsv"
    priority: 0
    threads: lambda wildcards: 1 if on_cluster() else workflow.cores
    params:
        planned=sealed("timing"),
        asked=asked_of("timings", "{timing}"),
