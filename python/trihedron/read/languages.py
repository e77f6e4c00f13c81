"""English for column names in other languages: Czech, Dutch, Finnish, French, German, Hungarian, Italian, Polish,
Portuguese, Russian, Scandinavian, Spanish, Turkish, Ukrainian, Chinese, Japanese, Korean, and the Greek letters of
equations. An unknown word is unchanged, and its column is not recognised."""

import re
import unicodedata

_MEANINGS = {
    "angular acceleration": "winkelbeschl\\w* 角加速度",
    "linear acceleration": "线加速度 线性加速度 線形加速度 線加速度",
    "gravity": "schwerkraft gravitat\\w* gravite gravedad gravidade гравит\\w* 重力 重力加速度",
    "magnetometer": "magnetfeld магн\\w* маг 磁场 磁場 磁力计 磁力計 地磁",
    "acceleration": "beschl\\w* acel\\w* przysp\\w* versnelling\\w* zrychl\\w* akselerasjon akceler\\w* "
    "ivme kiihtyvyys gyorsulas уск\\w* акс\\w* прискор\\w* 加速度 加速度计 加速度計 加速度センサー? 가속도",
    "gyro": "dreh dreh(rate|geschw)\\w* winkelgeschw\\w* kreisel\\w* giro\\w* zyro\\w* (hoek|draai)snelheid\\w* "
    "vinkelhastighe[dt] kulmanopeus szogsebesseg гир\\w* ω "
    "角速度 陀螺[仪儀]? ジャイロ 각속도 자이로",
    "angular": "angulaire\\w* angolar\\w* katow\\w* uhlov\\w* ac[iı]sal угл\\w* кутов\\w*",
    "velocity": "geschwindigkeit\\w* vitesse velocidad\\w* velocita predkosc rychlost h[iı]z скор\\w* швидк\\w*",
    "linear": "linear[ei]\\w* lineal\\w* lineaire\\w* liniow\\w* линейн\\w*",
    "time": "uhrzeit zeit zeitstempel temps horodatage heure tiempo tempo hora czas tijd cas zaman aika врем\\w* 시간 "
    "\\w*[时時][间間刻]\\w*",
    "temperature": "темп\\w* [温溫]度",
    "axis": "achse axe eje eixo asse axel osa ось оси [轴軸] 축",
    **{"s": "с сек sek 秒", "ms": "мс 毫秒", "us": "мкс 微秒", "m": "м", "rad": "рад", "deg": "град"},
    "x": "х",
    "y": "у",
    "": "по 的",
}
"""English words, and their translations as regular expressions of whole words without accents; ``х`` and ``у`` are
the Cyrillic letters that look like x and y."""
_ENGLISH = {english: re.compile("|".join(words.split())).fullmatch for english, words in _MEANINGS.items()}
_SENSORS = (["acceleration"], ["gyro"])
_OTHER_SCRIPT = "\u0370-\u03bb\u03bd-\u052f\u3040-\u30ff\u3400-\u9fff\uac00-\ud7af"
"""Greek, Cyrillic, kana, Han and Hangul; without the Greek letter that means micro."""
_BETWEEN_SCRIPTS = re.compile(
    f"(?<=[{_OTHER_SCRIPT}])(?=[A-Za-z])|(?<=[A-Za-z])(?=[{_OTHER_SCRIPT}])|(?=[轴軸])|(?<=[轴軸])"
)
_LOST = re.compile("\ufffd{2,}")
"""Replacement characters for letters that are not valid UTF-8."""


def plain(text: str) -> str:
    """The text without accents, with ASCII brackets, and with a blank where the script changes (``加速度X``)."""
    if text.isascii():
        return text
    # Only marks of European letters are removed; those of kana (U+3099) change the syllable.
    bare = "".join(c for c in unicodedata.normalize("NFD", text) if not "\u0300" <= c <= "\u036f")
    bare = unicodedata.normalize("NFC", bare).replace("μ", "µ").replace("º", "°").replace("（", "(").replace("）", ")")
    # Unreadable letters become a word, so that an "x" after them is not a column named x alone.
    return _BETWEEN_SCRIPTS.sub(" ", _LOST.sub(" unreadable ", bare))


def english(words: list[str]) -> list[str]:
    """Lower-case words translated to English; an axis letter attached to a sensor's name becomes a separate word."""
    out: list[str] = []
    for word in words:
        known = _translated(word)
        if known is not None and word[-1] in "xyz" and _translated(word[:-1]) in _SENSORS:
            known = [*known, word[-1]]
        out += [word] if known is None else known
    return out


def _translated(word: str) -> list[str] | None:
    return next((text.split() for text, fits in _ENGLISH.items() if fits(word)), None)
