# One scene, one reading of the paper's physics, one run, one file.


rule trajectory:
    input:
        not_stale,
    output:
        "results/{study}/runs/{run}.{preset}.h5",
    log:
        "results/{study}/logs/trajectory/{run}.{preset}.log",
    benchmark:
        "results/{study}/benchmarks/trajectory/{run}.{preset}.tsv"
    conda:
        "../envs/stiffdice.yaml"
    resources:
        mem_mb=growing(700),
        runtime=growing(5),
    params:
        planned=sealed("run"),
        asked=asked_of("trajectory", "{run}.{preset}"),
    script:
        "../scripts/trajectory.py"
