"""Named, reproducible studies: computed in pieces, kept in small files, checked against what was asked of them.

`indicial.studies.study` says what a study is; each study is a package of its own here.
"""

from indicial.studies.study import Study


def find_study(name: str) -> Study:
    """The study of that name.

    Raises
    ------
    InputError
        If there is none; the message lists those that there are.
    """
    from indicial.errors import InputError
    from indicial.studies.bocian import STUDY as BOCIAN
    from indicial.studies.finner import STUDY as FINNER
    from indicial.studies.freeflight import STUDY as FREEFLIGHT
    from indicial.studies.plate import STUDY as PLATE
    from indicial.studies.range import STUDY as RANGE

    known = {study.name: study for study in (BOCIAN, FINNER, FREEFLIGHT, PLATE, RANGE)}
    if name not in known:
        raise InputError(f"no study {name!r}; there are {', '.join(known)}")
    return known[name]


__all__ = ["Study", "find_study"]
