#!/usr/bin/env python3
"""Is this machine's own Vulkan good enough, so that no lavapipe has to be fetched?

    probe-vulkan.py auto|lavapipe|NAME [--layer]

Prints one line and exits 0 (good, the line names the device) or 1 (not good, the line says why).
Good is: a hardware driver with Vulkan 1.1, or Mesa's lavapipe from 25 on (22.3 draws multiview wrongly).
`lavapipe` asks for the latter only, NAME for a device whose name contains it; --layer asks for Khronos' validation layer too.
It asks the loader itself, because manifests on the disk do not say whether a device is really there.
"""

import ctypes
import re
import sys

VALIDATION = b"VK_LAYER_KHRONOS_validation"
CPU, HARDWARE = 4, (1, 2, 3)  # VkPhysicalDeviceType: integrated, discrete and virtual count as hardware
OLDEST_LAVAPIPE = 25


class ApplicationInfo(ctypes.Structure):
    """VkApplicationInfo: says that we speak Vulkan 1.1, which vkGetPhysicalDeviceProperties2 belongs to."""

    _fields_ = [
        ("s_type", ctypes.c_uint32),
        ("next", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("version", ctypes.c_uint32),
        ("engine", ctypes.c_char_p),
        ("engine_version", ctypes.c_uint32),
        ("api", ctypes.c_uint32),
    ]


class InstanceInfo(ctypes.Structure):
    """VkInstanceCreateInfo."""

    _fields_ = [
        ("s_type", ctypes.c_uint32),
        ("next", ctypes.c_void_p),
        ("flags", ctypes.c_uint32),
        ("application", ctypes.POINTER(ApplicationInfo)),
        ("layer_count", ctypes.c_uint32),
        ("layers", ctypes.c_void_p),
        ("extension_count", ctypes.c_uint32),
        ("extensions", ctypes.c_void_p),
    ]


class Driver(ctypes.Structure):
    """VkPhysicalDeviceDriverProperties. `info` holds Mesa's version; lavapipe's driverVersion is always 0.0.1."""

    _fields_ = [
        ("s_type", ctypes.c_uint32),
        ("next", ctypes.c_void_p),
        ("id", ctypes.c_uint32),
        ("name", ctypes.c_char * 256),
        ("info", ctypes.c_char * 256),
        ("conformance", ctypes.c_uint8 * 4),
    ]


class Properties(ctypes.Structure):
    """VkPhysicalDeviceProperties2; of its limits there is only the room."""

    _fields_ = [
        ("s_type", ctypes.c_uint32),
        ("next", ctypes.c_void_p),
        ("api", ctypes.c_uint32),
        ("driver_version", ctypes.c_uint32),
        ("vendor", ctypes.c_uint32),
        ("device", ctypes.c_uint32),
        ("kind", ctypes.c_uint32),
        ("name", ctypes.c_char * 256),
        ("rest", ctypes.c_uint64 * 256),
    ]


def devices(vulkan):
    """(properties, the driver's own words on its version) of every device."""
    instance = ctypes.c_void_p()
    application = ApplicationInfo(s_type=0, api=1 << 22 | 1 << 12)
    info = InstanceInfo(s_type=1, application=ctypes.pointer(application))
    if vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)) != 0:
        return []
    count = ctypes.c_uint32()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    handles = (ctypes.c_void_p * max(count.value, 1))()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), handles)
    found = []
    for handle in handles[: count.value]:
        driver = Driver(s_type=1000196000)
        one = Properties(s_type=1000059001, next=ctypes.addressof(driver))
        vulkan.vkGetPhysicalDeviceProperties2(ctypes.c_void_p(handle), ctypes.byref(one))
        found.append((one, driver.info.decode(errors="replace")))
    return found


def has_validation_layer(vulkan):
    count = ctypes.c_uint32()
    vulkan.vkEnumerateInstanceLayerProperties(ctypes.byref(count), None)
    # VkLayerProperties: name[256], two u32, description[256].
    size = 256 + 4 + 4 + 256
    room = ctypes.create_string_buffer(size * max(count.value, 1))
    vulkan.vkEnumerateInstanceLayerProperties(ctypes.byref(count), room)
    names = (room.raw[i * size : i * size + 256].split(b"\0")[0] for i in range(count.value))
    return VALIDATION in names


def verdict(wanted, need_layer):
    try:
        vulkan = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return False, "no Vulkan loader (libvulkan.so.1)"
    found = devices(vulkan)
    if not found:
        return False, "its Vulkan loader finds no device"
    rejected = []
    for one, driver in sorted(found, key=lambda pair: pair[0].kind == CPU):
        name = one.name.decode(errors="replace")
        is_lavapipe = one.kind == CPU and name.startswith("llvmpipe")
        mesa = re.match(r"Mesa (\d+)\.", driver)
        if wanted == "lavapipe":
            asked_for = is_lavapipe
        else:
            asked_for = wanted == "auto" or wanted.lower() in name.lower()
        if not asked_for:
            rejected.append(f"{name} is not what was asked for")
        elif is_lavapipe and (not mesa or int(mesa[1]) < OLDEST_LAVAPIPE):
            rejected.append(f"its lavapipe ({driver}) is older than Mesa {OLDEST_LAVAPIPE}")
        elif not is_lavapipe and one.kind not in HARDWARE:
            rejected.append(f"{name} is neither hardware nor lavapipe")
        elif (one.api >> 22 & 0x7F, one.api >> 12 & 0x3FF) < (1, 1):
            rejected.append(f"{name} has only Vulkan 1.0")
        elif need_layer and not has_validation_layer(vulkan):
            return False, f"{name} is good, but Khronos' validation layer, which the tests run under, is missing"
        else:
            return True, f"{name}, {driver}" if driver else name
    return False, "; ".join(rejected)


good, line = verdict(sys.argv[1], "--layer" in sys.argv[2:])
print(line)
sys.exit(0 if good else 1)
