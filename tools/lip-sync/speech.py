#!/usr/bin/env python3
"""Speech with known phonemes, by espeak-ng (apt-get install espeak-ng): what the network of lip-sync learns from and is judged by.

    tools/lip-sync/speech.py train FILE      sentences and voices for training
    tools/lip-sync/speech.py held-out FILE   other sentences by other voices
    tools/lip-sync/speech.py fixture FILE    a small part of held-out, of which the example `train` makes the tests' file

A file is a sequence of utterances, little-endian: u32 sample rate (Hz), u32 count of samples, the samples as i16, u32 count of
marks, and for each mark u32 sample at which it begins and u8 class (the order of CLASSES). Marks are espeak-ng's own phoneme
events; a diphthong is two marks, as its halves have two mouth shapes."""

import ctypes
import random
import struct
import sys

CLASSES = ["silence", "a", "e", "i", "o", "u", "fv", "mbp", "other"]

# The first letter of a phoneme in IPA says which mouth it has. All open vowels are "a", also ɒ, whose lips are hardly
# round. Schwa, short or long (ɜ), and the vowels that English and German reduce to it have no shape of their own: they are "other", as the tongue's consonants are.
# Rounded front vowels have the lips of u and o, which is what is seen.
SHAPES = {
    "a": "aɑæʌɶɒ", "e": "eɛ", "i": "iɪɨᵻ", "o": "oɔɤœø", "u": "uʊɯwʉyʏɥ", "fv": "fvʋ", "mbp": "mbpβɓ",
}

TRAIN_VARIANTS = ["", "m1", "m2", "m3", "m5", "m7", "m8", "f1", "f2", "f4", "adam", "anika", "belinda", "boris", "caleb", "ed",
                  "gustave", "iven", "john", "linda", "max", "norbert", "pablo", "quincy", "shelby", "travis", "victor", "Alex",
                  "Denis", "Gene", "Lee", "Mario", "Michael", "Storm", "steph2", "klatt2", "Andy", "Annie", "Diogo", "Henrique",
                  "Hugo", "Jacky", "Marco", "Nguyen", "Tweaky", "RicishayMax", "aunty", "benjamin", "david", "edward", "grandma",
                  "grandpa", "iven2", "iven3", "kaukovalta", "klatt4", "marcelo", "miguel", "pedro", "rob", "sandro", "michel"]
HELD_OUT_VARIANTS = ["m4", "m6", "f3", "f5", "Alicia", "Andrea", "paul", "antonio", "zac", "steph"]
VOICES = {"en": ["en-us", "en"], "de": ["de"], "fr": ["fr"], "es": ["es", "es-419"]}

TRAIN = {
    "en": """The boy found my house near the old farm. Five people move slowly over the frozen river. Please bring both of the heavy
boxes up the stairs. We talked about music, food and the weather for hours. Can you see the blue boat from your window? She
opened the door and looked into the empty room. Maybe we should leave before the traffic gets worse. I have never been to
that part of the city. The soup is too hot to eat, so wait a moment. My brother bought a new camera last month. Good morning
everybody, how are you feeling today? The moon was full and the garden was full of shadows. He put the book on the table and
went to bed. Few of us knew what the problem really was. Give me the keys and I will move the van. Apples, pears and plums
grow behind the barn. They moved the piano through the front door. You can hear the waves all night long. It rained on Monday
but the sun came out by noon. The baby is asleep, so please be quiet. Our team won four of the five games. I would love to
have a cup of coffee. Who took the last piece of cake? The bus arrives at half past eight. Nobody told me that the meeting
was off. A large dog ran across the muddy field. Take the second street on your left. We need more time to finish the job
properly. That movie made me laugh and cry. Push the green button and pull the lever. The phone rang but no one picked it up.
Paint the wall with a wide brush. Her voice was calm and warm. Show me how you do it once more. Both ovens were far too cold
for bread. The law does not allow that at all. Ten men sent the best men west. Ask her father whether the car park is far.
Go home, Joe, and close the old window. Who knew the blue shoes were so cool and new?""",
    "de": """Guten Morgen, wie geht es Ihnen heute? Der alte Mann wohnt am Ende der Straße. Wir fahren morgen früh mit dem Boot über
den Fluss. Bitte mach die Tür zu, es ist kalt. Meine Mutter backt am Sonntag einen Apfelkuchen. Das Buch liegt oben auf dem
Tisch. Fünf Vögel flogen über das weite Feld. Ich habe gestern einen guten Film gesehen. Kannst du mir bitte das Brot geben?
Im Sommer blühen die Blumen vor dem Haus. Er möchte nie wieder so spät nach Hause kommen. Die Musik war viel zu laut. Unser
Zug fährt um halb acht vom Bahnhof ab. Viele Menschen warten auf den Bus. Das Wasser im See war schön warm. Wo hast du den
Schlüssel hingelegt? Sie sprach langsam und mit ruhiger Stimme. Am Abend gehen wir gern in den Park. Der Hund bellt, weil
jemand vor der Tür steht. Ohne Mut und Geduld geht es nicht. Zwölf Boxkämpfer jagen Viktor quer über den Deich. Gib mir die
blaue Lampe. Papa mag Banane und Ananas. Alle Bäume haben braune Blätter bekommen. Lieber Peter, schreib mir bald wieder. Die
Schule beginnt im August.""",
    "fr": """Bonjour, comment allez-vous ce matin? Le petit chat dort sur le fauteuil. Nous avons mangé une bonne soupe chaude. Il faut
beaucoup de patience pour apprendre la musique. La fenêtre du salon donne sur le jardin. Ma voisine part à Paris demain soir.
Est-ce que vous pouvez fermer la porte? Mon père a acheté une voiture bleue. Les enfants jouent au ballon dans la cour. Elle
voudrait boire un verre d'eau. Le train arrive toujours à l'heure. On a vu un très beau film hier. Tu as oublié ton parapluie
à la maison. Le vent souffle fort au bord de la mer. Il y a du monde dans la rue. Je ne sais pas où il habite. Une pomme par
jour, c'est bon pour la santé. Vous parlez trop vite pour moi. La lune brille sur le fleuve. Bravo, vous avez gagné!""",
    "es": """Buenos días, ¿cómo está usted? La casa de mi abuela está cerca del río. Mañana vamos a viajar en barco. El perro come mucho
y duerme poco. Por favor, abre la puerta. Mi hermano compró un coche nuevo. Me gusta mucho la música de los años sesenta. Una
familia feliz vive en el pueblo. ¿Puedes traer el vaso azul? La luna llena ilumina el campo. Todos los lunes hay mercado en
la plaza. No sé dónde puse las llaves. El agua está muy fría para nadar. Ella vive en una ciudad muy bonita. Hace falta un
poco de paciencia. Vamos a ver una película esta noche. El fuego quemó los muebles viejos. Tú bebes café y yo bebo té.""",
}
HELD_OUT = {
    "en": """The north wind and the sun were arguing about which of them was stronger. A traveller came along wrapped in a warm cloak.
The birch canoe slid on the smooth planks. Glue the sheet to the dark blue background. These days a chicken leg is a rare
dish. Rice is often served in round bowls. The juice of lemons makes fine punch. Four hours of steady work faced us. A pot of
tea helps to pass the evening. The source of the huge river is the clear spring. Kick the ball straight and follow through.""",
    "de": """Einst stritten sich Nordwind und Sonne, wer von ihnen beiden wohl der Stärkere wäre. Ein Wanderer, der in einen warmen
Mantel gehüllt war, kam des Weges daher. Im Hafen liegen neun große Schiffe. Opa repariert die kaputte Uhr.""",
    "fr": """La bise et le soleil se disputaient, chacun assurant qu'il était le plus fort. Ils ont vu un voyageur qui s'avançait,
enveloppé dans son manteau. Le bateau quitte le port à midi. Mon ami prépare un gâteau aux noix.""",
    "es": """El viento norte y el sol discutían por saber quién era el más fuerte. Pasó un viajero cubierto con una capa ancha. El
tren sale de la estación a las ocho. Mis amigos cantan una canción muy antigua.""",
}


class Value(ctypes.Union):
    _fields_ = [("number", ctypes.c_int), ("name", ctypes.c_char_p), ("string", ctypes.c_char * 8)]


class Event(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("unique", ctypes.c_uint), ("text", ctypes.c_int), ("length", ctypes.c_int),
                ("audio_ms", ctypes.c_int), ("sample", ctypes.c_int), ("user", ctypes.c_void_p), ("id", Value)]


CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(Event))
SYNCHRONOUS, PHONEME_EVENTS, IPA, UTF8, PHONEME = 2, 1, 2, 1, 7
SPEED, PITCH, RANGE = 1, 3, 4


def shape(letter):
    return next((name for name, letters in SHAPES.items() if letter in letters), None)


def marks_of(sounds, end):
    """Classes of phonemes: `sounds` are (sample, IPA)."""
    marks = []
    for (begin, name), (until, _) in zip(sounds, sounds[1:] + [(end, "")]):
        letters = [c for c in name if c.isalpha() and c not in "ːˈˌʲʰ"]
        if not letters:
            marks.append((begin, "silence"))
            continue
        shapes = [shape(c) or "other" for c in letters]
        vowels = all(s in "aeiou" or s == "other" for s in shapes) and shapes[0] in ("a", "e", "i", "o", "u")
        marks.append((begin, shapes[0]))
        if len(shapes) > 1 and vowels and shapes[1] != shapes[0]:
            marks.append((begin + (until - begin) * 55 // 100, shapes[1]))
    return marks


class Speaker:
    def __init__(self):
        self.library = ctypes.CDLL("libespeak-ng.so.1")
        self.rate = self.library.espeak_Initialize(SYNCHRONOUS, 0, None, PHONEME_EVENTS | IPA)
        self.callback = CALLBACK(self.hear)
        self.library.espeak_SetSynthCallback(self.callback)

    def hear(self, samples, count, events):
        if samples and count:
            self.samples += ctypes.string_at(samples, 2 * count)
        at = 0
        while events[at].type:
            if events[at].type == PHONEME:
                name = bytes(events[at].id.string).split(b"\0")[0].decode("utf8", "ignore")
                self.sounds.append((max(events[at].sample, 0), name))
            at += 1
        return 0

    def say(self, text, voice, speed, pitch, lively):
        """The utterance as bytes."""
        self.samples, self.sounds = b"", []
        if self.library.espeak_SetVoiceByName(voice.encode()):
            sys.exit(f"espeak-ng has no voice {voice}")
        for what, value in [(SPEED, speed), (PITCH, pitch), (RANGE, lively)]:
            self.library.espeak_SetParameter(what, value, 0)
        text = text.encode()
        self.library.espeak_Synth(text, len(text) + 1, 0, 1, 0, UTF8, None, None)
        self.library.espeak_Synchronize()
        count = len(self.samples) // 2
        marks = marks_of(self.sounds, count)
        head = struct.pack("<II", self.rate, count) + self.samples + struct.pack("<I", len(marks))
        return head + b"".join(struct.pack("<IB", at, CLASSES.index(name)) for at, name in marks)


def sentences(text):
    found, begin = [], 0
    text = " ".join(text.split())
    for at, letter in enumerate(text):
        if letter in ".?!":
            found.append(text[begin : at + 1].strip())
            begin = at + 1
    return found


def main(what, path):
    speaker, chance = Speaker(), random.Random(7 if what == "train" else 11)
    texts, variants = (TRAIN, TRAIN_VARIANTS) if what == "train" else (HELD_OUT, HELD_OUT_VARIANTS)
    with open(path, "wb") as file:
        for language, text in texts.items():
            said = sentences(text)
            if what == "train":
                # The words of a language in any order are sequences of sounds that its sentences lack.
                words = text.replace(".", " ").replace("?", " ").replace("!", " ").split()
                said += [" ".join(chance.sample(words, 7)) + "." for _ in range(len(said))]
            # Of the fixture, each language has other two.
            own = variants if what != "fixture" else [v for k, v in enumerate(variants[:8]) if k % 4 == list(texts).index(language)]
            for variant in own:
                for voice in VOICES[language] if what != "fixture" else VOICES[language][:1]:
                    some = chance.sample(said, min(len(said), {"train": 9, "held-out": 4, "fixture": 1}[what]))
                    for sentence in some:
                        name = f"{voice}+{variant}" if variant else voice
                        file.write(speaker.say(sentence, name, chance.randint(120, 210), chance.randint(25, 75), chance.randint(30, 75)))


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("train", "held-out", "fixture"):
        sys.exit(__doc__)
    main(*sys.argv[1:])
