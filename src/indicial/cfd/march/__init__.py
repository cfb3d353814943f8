"""cfd/march"""
