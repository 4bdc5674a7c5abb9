"""Sample scenes made by script, each named by what it stresses.

``python -m meniscus.samples.<name> --output file.blend`` builds one; ``python -m meniscus.samples.demo`` renders one.
"""
