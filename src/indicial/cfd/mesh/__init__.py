"""cfd/mesh"""
