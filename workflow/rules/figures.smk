# Datasets in, figures out.


rule figure:
    input:
        unpack(data_of),
    output:
        report(
            "results/{study}/figures/{figure}.svg",
            caption="../report/figure.rst",
            category="{study}",
            labels={"what": "{figure}"},
        ),
        "results/{study}/figures/{figure}.png",
    params:
        figure=lambda wildcards: planned_figure(wildcards),
        dpi=lambda wildcards: study(wildcards.study).dpi,
        code=code_of("figure.py", "stiffdice.figures", "stiffdice.io.read", "stiffdice.io.write"),
    log:
        "results/{study}/logs/figure/{figure}.log",
    benchmark:
        "results/{study}/benchmarks/figure/{figure}.tsv"
    resources:
        mem_mb=700,
        runtime=5,
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/figure.py"


use rule figure as animation with:
    output:
        report(
            "results/{study}/figures/{figure}.gif",
            caption="../report/figure.rst",
            category="{study}",
            labels={"what": "{figure}"},
        ),
    params:
        figure=lambda wildcards: planned_figure(wildcards),
        dpi=80,  # for screens, whatever the study asks of its PNG files
        code=code_of("figure.py", "stiffdice.figures", "stiffdice.io.read", "stiffdice.io.write"),
    log:
        "results/{study}/logs/animation/{figure}.log",
    benchmark:
        "results/{study}/benchmarks/animation/{figure}.tsv"
