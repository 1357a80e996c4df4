# One page for a browser, published from the studies that are stored; none is made for it.


rule explorer:
    input:
        always,
    output:
        "results/explorer.html",
    params:
        asked="the studies that are stored",
    log:
        "results/explorer.log",
    resources:
        mem_mb=growing(1000),
        runtime=growing(5),
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/explorer.py"
