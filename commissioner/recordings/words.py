"""Words of other languages as those that names are looked for by: columns, test sheets, makers' sheets and prefaces alike."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from functools import lru_cache

MOST_KEPT = 4096
"""Names of which is kept what they mean: a table's head is read in many ways."""

TRANSLATED = {
    "时间": "time", "時間": "time", "tiempo": "time", "tempo": "time", "tijd": "time", "czas": "time", "время": "time",
    "电流": "current", "電流": "current", "corriente": "current", "corrientes": "current", "correntes": "current", "tensiones": "voltage", "tensões": "voltage", "intensidad": "current", "corrente": "current", "stroom": "current",
    "ток": "current", "strom": "strom", "ström": "current", "prad": "current", "prąd": "current",
    "电压": "voltage", "電圧": "voltage", "電壓": "voltage", "tensión": "voltage", "tensão": "voltage",
    "tensione": "voltage", "tensioni": "voltage", "correnti": "current", "voltaje": "voltage", "spanning": "voltage", "напряжение": "voltage",
    "spänning": "voltage", "napiecie": "voltage", "napięcie": "voltage", "转速": "speed", "速度": "speed", "vitesse": "speed", "velocidad": "speed",
    "velocità": "speed", "giri": "speed", "giri nominali": "nominal speed", "revoluciones": "speed", "courant": "current", "tension": "voltage", "tensions": "voltage", "courants": "current", "salida": "output",
    "leiterstrom": "strom", "außenleiterstrom": "strom", "netzstrom": "strom", "motorstrom": "strom", "leiterspannung": "spannung",
    "außenleiterspannung": "spannung", "netzspannung": "spannung", "motorspannung": "spannung", "intensité": "current",
    "čas": "time", "proud": "current", "napětí": "voltage", "tid": "time", "strøm": "current", "spænding": "voltage", "spenning": "voltage",
    "aika": "time", "virta": "current", "jännite": "voltage", "zaman": "time", "akım": "current", "gerilim": "voltage", "composée": " ", "compuesta": " ", "concatenata": " ", "verkettete": " ",
    "线": " ", "線": " ", "相": " ", "第": " ", "路": " ",
    "frecuencia": "frequency", "frequenza": "frequency", "fréquence": "frequency", "frequenz": "frequency",
    "potencia": "power", "potenza": "power", "puissance": "power", "leistung": "power", "aufnahmeleistung": "input power",
    "leistungsaufnahme": "input power", "wirkleistung": "active power", "tra le": "between", "tra i": "between", "entre las": "between", "entre les": "between",
    "absorbida": "input", "assorbita": "input", "absorbée": "input", "aufgenommene": "input", "útil": "output", "utile": "output",
    "resa": "output", "totale": "total", "activa": "active", "attiva": "active", "media": "mean", "medio": "mean", "moyenne": "mean",
    "moyen": "mean", "mittlere": "mean", "mittlerer": "mean",
    "par": "torque", "par phase": "per phase", "coppia": "torque", "couple": "torque", "rendimiento": "efficiency",
    "rendimento": "efficiency", "rendement": "efficiency", "deslizamiento": "slip", "scorrimento": "slip", "glissement": "slip",
    "factor de potencia": "power factor", "fattore di potenza": "power factor", "facteur de puissance": "power factor",
    "coseno": "cos", "cosfi": "cos phi", "fi": "phi", "inercia": "inertia", "inerzia": "inertia", "inertie": "inertia",
    "momento de inercia": "moment of inertia", "momento di inerzia": "moment of inertia", "momento d'inerzia": "moment of inertia",
    "moment d'inertie": "moment of inertia", "polos": "poles", "poli": "poles", "pôles": "poles", "número de": "number of",
    "numero di": "number of", "nombre de": "number of", "pares de polos": "pole pairs", "coppie di poli": "pole pairs",
    "coppie polari": "pole pairs", "paires de pôles": "pole pairs", "conexión": "connection", "collegamento": "connection",
    "couplage": "connection", "temperatura": "temperature", "température": "temperature",
    "resistencia": "resistance", "resistenza": "resistance", "résistance": "resistance", "widerstand": "resistance",
    "estator": "stator", "statore": "stator", "statorique": "stator", "estatórica": "stator", "statorica": "stator",
    "devanado": "winding", "bobinado": "winding", "arrollamiento": "winding", "avvolgimento": "winding", "enroulement": "winding",
    "enroulements": "winding", "devanados": "winding", "bobinados": "winding", "avvolgimenti": "winding", "enrolamento": "winding",
    "enrolamentos": "winding", "do enrolamento": "winding", "dos enrolamentos": "winding", "do estator": "stator", "par enroulement": "per winding", "terminais": "terminals",
    "tra le fasi": "between phase", "fra le fasi": "between phase", "fra i": "between", "fra le": "between",
    "lignes": "line", "líneas": "line", "linhas": "line", "linha": "line", "linee": "line",
    "bornes": "terminals", "bornas": "terminals", "terminales": "terminals", "terminali": "terminals", "morsetti": "terminals",
    "entre": "between", "tra": "between", "fra": "between", "por": "per", "línea": "line", "linea": "line", "ligne": "line",
    "fase": "phase", "fases": "phase", "fasi": "phase", "simple": "phase", "semplice": "phase", "stellata": "star", "sternspannung": "star spannung",
    "neutro": "neutral", "neutre": "neutral", "neutra": "neutral",
    "arranque": "starting", "avviamento": "starting", "spunto": "starting", "démarrage": "starting", "máximo": "maximum",
    "máxima": "maximum", "massima": "maximum", "massimo": "maximum", "maximal": "maximum", "maximale": "maximum",
    "nominale": "nominal", "nominales": "nominal", "asignada": "nominal", "asignado": "nominal", "assignée": "nominal", "assigné": "nominal",
    "ensayo": "test", "prueba": "test", "prova": "test", "essai": "test", "versuch": "test", "prüfung": "test",
    "vacío": "no load", "en vacío": "no load", "a vuoto": "no load", "in vuoto": "no load", "à vide": "no load", "leerlauf": "no load",
    "charge": "load", "carga": "load", "carico": "load", "en charge": "load", "con carga": "load", "em carga": "load", "sotto carico": "load",
    "pleine charge": "full load", "plena carga": "full load", "pieno carico": "full load", "sans charge": "no load", "sin carga": "no load",
    "sem carga": "no load", "senza carico": "no load", "em vazio": "no load", "ensaio": "test", "nullast": "no load", "proef": "test", "kortsluiting": "short circuit",
    "frequência": "frequency", "frequentie": "frequency", "potência": "power", "vermogen": "power", "velocidade": "speed",
    "toerental": "speed", "weerstand": "resistance",
    "rotor bloqueado": "locked rotor", "a rotor bloqueado": "locked rotor", "a rotore bloccato": "locked rotor", "à rotor bloqué": "locked rotor", "rotor trabado": "locked rotor", "rotore bloccato": "locked rotor", "rotor bloqué": "locked rotor",
    "rotor calé": "locked rotor", "cortocircuito": "short circuit", "corto circuito": "short circuit", "court-circuit": "short circuit",
    "court circuit": "short circuit", "corriente continua": "direct current", "corrente continua": "direct current",
    "courant continu": "direct current", "gleichstrom": "direct current",
    "período de muestreo": "sample period", "periodo de muestreo": "sample period", "tiempo de muestreo": "sample period",
    "intervalo de muestreo": "sample interval", "frecuencia de muestreo": "sample rate", "tasa de muestreo": "sample rate",
    "periodo di campionamento": "sample period", "tempo di campionamento": "sample period", "intervallo di campionamento": "sample interval",
    "frequenza di campionamento": "sample rate", "passo di campionamento": "sample interval",
    "fréquence d'échantillonnage": "sample rate", "fréquence d’échantillonnage": "sample rate", "cadence d'échantillonnage": "sample rate",
    "période d'échantillonnage": "sample period", "pas d'échantillonnage": "sample interval", "pas de temps": "time step",
    "paso de tiempo": "time step", "passo temporale": "time step", "passo di tempo": "time step", "zeitschritt": "time step",
    "schrittweite": "time step", "frecuencia de adquisición": "sample rate", "frequenza di acquisizione": "sample rate",
    "de": " ", "del": " ", "de la": " ", "di": " ", "dello": " ", "della": " ", "du": " ", "des": " ", "d'": " ", "dell'": " ",
    "l'": " ", "d'un": " ", "de los": " ", "degli": " ", "en la": " ", "nella": " ", "al": " ", "allo": " ", "alla": " ",
    "znamionowa": "nominal", "znamionowe": "nominal", "znamionowy": "nominal", "znamionowej": "nominal", "anma": "nominal",
    "moc": "power", "mocy": "power", "güç": "power", "gücü": "power", "výkon": "power", "effekt": "power", "мощность": "power",
    "功率": "power", "częstotliwość": "frequency", "frekans": "frequency", "frekansı": "frequency", "frekvence": "frequency",
    "frekvens": "frequency", "частота": "frequency", "频率": "frequency", "prędkość": "speed", "obroty": "speed", "hız": "speed",
    "hızı": "speed", "devir": "speed", "devri": "speed", "rotação": "speed", "sprawność": "efficiency", "verim": "efficiency",
    "verimi": "efficiency", "współczynnik mocy": "power factor", "güç faktörü": "power factor", "güç katsayısı": "power factor",
    "fator de potência": "power factor", "moment bezwładności": "moment of inertia", "atalet momenti": "moment of inertia",
    "momento de inércia": "moment of inertia", "inércia": "inertia", "faza": "phase", "fazy": "phase", "fazowe": "phase",
    "fazowy": "phase", "faz": "phase", "fazı": "phase", "międzyfazowe": " ", "międzyfazowy": " ", "przewodowe": " ", "przewodowy": " ",
    "rezystancja": "resistance", "direnç": "resistance", "direnci": "resistance", "resistência": "resistance", "uzwojenia": "winding",
    "uzwojenie": "winding", "sargı": "winding", "między": "between", "zaciskami": "terminals", "zaciski": "terminals", "próba": "test",
    "deney": "test", "deneyi": "test", "zkouška": "test", "prov": "test", "опыт": "test", "试验": "test", "bieg jałowy": "no load",
    "biegu jałowego": "no load", "na biegu jałowym": "no load", "boşta": "no load", "boşta çalışma": "no load", "yüksüz": "no load",
    "naprázdno": "no load", "tomgång": "no load", "холостой ход": "no load", "空载": "no load", "zwarcie": "short circuit",
    "zwarcia": "short circuit", "kısa devre": "short circuit", "nakrátko": "short circuit", "kortslutning": "short circuit",
    "короткое замыкание": "short circuit", "kilitli rotor": "locked rotor", "rotor travado": "locked rotor", "堵转": "locked rotor",
    "prąd stały": "direct current", "doğru akım": "direct current", "stejnosměrný proud": "direct current", "likström": "direct current",
    "gelijkstroom": "direct current", "постоянный ток": "direct current", "直流": "direct current", "obciążenie": "load", "yük": "load",
    "średnia": "mean", "średni": "mean", "ortalama": "mean", "rozruchowy": "starting", "partida": "starting", "kalkış": "starting",
    "conjugado": "torque", "liczba biegunów": "number of poles", "kutup sayısı": "number of poles", "połączenie": "connection",
    "bağlantı": "connection", "ligação": "connection", "süre": "time", "instante": "time", "akımı": "current", "gerilimi": "voltage",
    "příkon": "input power", "phasenstrom": "phase strom", "da": " ", "das": " ", "dos": " ",
    "時刻": "time", "경과": " ", "시간": "time", "시각": "time", "전류": "current", "전압": "voltage", "선간": " ", "상": " ",
    "lijnspanning": "voltage", "netspanning": "voltage", "motorspanning": "voltage", "lijnstroom": "current", "motorstroom": "current",
    "fasestroom": "phase current", "струм": "current", "напруга": "voltage", "час": "time", "фазы": "phase", "фази": "phase", "фаза": "phase",
    "линейное": " ", "фазный": "phase", "напрежение": "voltage", "време": "time", "χρόνος": "time", "ρεύμα": "current", "τάση": "voltage",
    "φάση": "phase", "idő": "time", "áram": "current", "feszültség": "voltage", "fázis": "phase", "timp": "time", "curent": "current",
    "curentul": "current", "tensiune": "voltage", "tensiunea": "voltage", "vrijeme": "time", "vreme": "time",
    "struja": "current", "napon": "voltage", "napetost": "voltage", "tok": "current", "napätie": "voltage", "prúd": "current",
}  # fmt: skip
"""What only joins names is a space. With their accents, which name the code page of a text; looked for with or without them."""


@lru_cache(MOST_KEPT)
def folded(text: str) -> str:
    """The text without marks above and below its letters: `Fréquence` as `Frequence`, `akım` as `akim`, `außen` as `aussen`."""
    return (
        "".join(c for c in unicodedata.normalize("NFD", text) if not unicodedata.combining(c))
        .replace("ı", "i")
        .replace("ł", "l")
        .replace("Ł", "L")
        .replace("ß", "ss")
    )


@lru_cache(MOST_KEPT)
def translated(name: str) -> str:
    """The name with words of other languages replaced by those that are looked for; any other name as it is."""
    plain = folded(name).replace("\u2019", "'")
    out = _ANY.sub(lambda found: f" {_BY_PLAIN.get(found[0].lower(), found[0])} ", plain)
    return name if out == plain else " ".join(out.split())


def readings(name: str) -> tuple[str, ...]:
    """The name in the words that are looked for; of one that says its noun first (`Potencia nominal`), with it last as well."""
    said = translated(name)
    first, _, rest = said.partition(" ")
    return (said, f"{rest} {first}") if rest and said != name else (said,)


def _any_of(words: Iterable[str]) -> str:
    return "|".join(map(re.escape, sorted(words, key=len, reverse=True)))


_BY_PLAIN = {folded(word): ours for word, ours in TRANSLATED.items()}
_ELIDED = [word for word in _BY_PLAIN if word.endswith("'")]
_LATIN = [word for word in _BY_PLAIN if word.isascii() and word not in _ELIDED]
_OTHERS = [word for word in _BY_PLAIN if not word.isascii()]
_ANY = re.compile(rf"(?<![a-z])(?:(?:{_any_of(_LATIN)})(?![a-z])|{_any_of(_ELIDED)})|{_any_of(_OTHERS)}", re.IGNORECASE)
