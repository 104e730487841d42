"""Exchange linear models with other tools: python-control, MATLAB files, OpenFAST linearisations, C controllers."""
