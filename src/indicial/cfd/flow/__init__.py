"""cfd/flow"""
