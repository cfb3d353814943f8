"""flightsim"""
