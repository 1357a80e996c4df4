# One scene, one reading of the paper's physics, one run, one file.


rule trajectory:
    input:
        scene=lambda wildcards: planned_run(wildcards).scene,
    output:
        "results/{study}/runs/{run}.{preset}.h5",
    params:
        run=lambda wildcards: planned_run(wildcards),
        code=lambda wildcards: code_of_runs(
            "trajectory.py",
            planned_run(wildcards).simulator,
            "stiffdice.io.layout",
            "stiffdice.ledger",
            "stiffdice.io.write",
        ),
    log:
        "results/{study}/logs/trajectory/{run}.{preset}.log",
    benchmark:
        "results/{study}/benchmarks/trajectory/{run}.{preset}.tsv"
    resources:
        mem_mb=growing(500),
        runtime=growing(5),
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/trajectory.py"
