#!/usr/bin/env python3
"""Is this machine's own Vulkan good enough, so that no lavapipe has to be fetched?

    probe-vulkan.py auto|lavapipe|NAME [--layer]

Prints one line and exits 0 (good, the line names the device) or 1 (not good, the line says why).
Only the device that the program would open is judged, as xr-renderer/vulkan/src/choice.rs chooses it: the best of those asked for.
Good is: hardware that can do what xr-renderer/vulkan/src/physical.rs asks for, or Mesa's lavapipe from 25 on (22.3 draws multiview
wrongly). `lavapipe` asks for the latter only, NAME for a device whose name contains it; --layer asks for Khronos' validation
layer too. It asks the loader itself, because manifests on the disk do not say whether a device is really there.
"""

import ctypes
import re
import sys

VALIDATION = b"VK_LAYER_KHRONOS_validation"
CPU = 4
RANKS = {2: 0, 1: 1, 3: 2, CPU: 3}  # VkPhysicalDeviceType: discrete before integrated before virtual before CPU
LLVMPIPE = 13  # VkDriverId
DRAWS_AND_COMPUTES = 1 | 2  # VkQueueFlags
COMPUTE_STAGE = 0x20  # VkShaderStageFlags
SUBGROUP_OPERATIONS = {1: "basic", 2: "vote", 4: "arithmetic", 8: "ballot", 0x10: "shuffle"}  # VkSubgroupFeatureFlags
SUBGROUP_SIZES = (4, 8, 16, 32, 64, 128)
WORKGROUP = 256
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


class Subgroup(ctypes.Structure):
    """VkPhysicalDeviceSubgroupProperties."""

    _fields_ = [
        ("s_type", ctypes.c_uint32),
        ("next", ctypes.c_void_p),
        ("size", ctypes.c_uint32),
        ("stages", ctypes.c_uint32),
        ("operations", ctypes.c_uint32),
        ("quad_in_all_stages", ctypes.c_uint32),
    ]


class Limits(ctypes.Structure):
    """VkPhysicalDeviceLimits, of which only those of compute shaders are named."""

    _fields_ = [
        ("before", ctypes.c_uint64 * 27),
        ("shared_memory", ctypes.c_uint32),
        ("group_count", ctypes.c_uint32 * 3),
        ("group_invocations", ctypes.c_uint32),
        ("group_size", ctypes.c_uint32 * 3),
        ("after", ctypes.c_uint64 * 32),
    ]


class Properties(ctypes.Structure):
    """VkPhysicalDeviceProperties and some room: what follows the limits is not read."""

    _fields_ = [
        ("api", ctypes.c_uint32),
        ("driver_version", ctypes.c_uint32),
        ("vendor", ctypes.c_uint32),
        ("device", ctypes.c_uint32),
        ("kind", ctypes.c_uint32),
        ("name", ctypes.c_char * 256),
        ("cache_uuid", ctypes.c_uint8 * 16),
        ("limits", Limits),
        ("rest", ctypes.c_uint64 * 16),
    ]


class Properties2(ctypes.Structure):
    """VkPhysicalDeviceProperties2."""

    _fields_ = [("s_type", ctypes.c_uint32), ("next", ctypes.c_void_p), ("properties", Properties)]


class QueueFamily(ctypes.Structure):
    """VkQueueFamilyProperties."""

    _fields_ = [("flags", ctypes.c_uint32), ("count", ctypes.c_uint32), ("rest", ctypes.c_uint32 * 4)]


class Device:
    """What a device says of itself."""

    def __init__(self, vulkan, handle):
        handle = ctypes.c_void_p(handle)
        basic = Properties()
        vulkan.vkGetPhysicalDeviceProperties(handle, ctypes.byref(basic))
        self.name = basic.name.decode(errors="replace")
        self.kind = basic.kind
        self.api = (basic.api >> 22 & 0x7F, basic.api >> 12 & 0x3FF)
        self.limits = basic.limits
        self.driver, self.subgroup = Driver(s_type=1000196000), Subgroup(s_type=1000094000)
        if self.api >= (1, 1):
            # A driver that does not know the first structure passes it over and fills the second.
            self.driver.next = ctypes.addressof(self.subgroup)
            more = Properties2(s_type=1000059001, next=ctypes.addressof(self.driver))
            vulkan.vkGetPhysicalDeviceProperties2(handle, ctypes.byref(more))
        self.info = self.driver.info.decode(errors="replace")
        self.is_lavapipe = self.driver.id == LLVMPIPE or "llvmpipe" in self.name
        count = ctypes.c_uint32()
        vulkan.vkGetPhysicalDeviceQueueFamilyProperties(handle, ctypes.byref(count), None)
        families = (QueueFamily * max(count.value, 1))()
        vulkan.vkGetPhysicalDeviceQueueFamilyProperties(handle, ctypes.byref(count), families)
        self.queues = [family.flags for family in families[: count.value]]

    def is_asked_for(self, wanted):
        """As `GpuChoice::accepts` in xr-renderer/vulkan/src/choice.rs."""
        if wanted == "lavapipe":
            return self.is_lavapipe
        return wanted == "auto" or wanted.lower() in self.name.lower()

    def lacks(self):
        """What the program needs and this has not, as in xr-renderer/vulkan/src/physical.rs."""
        if self.api < (1, 1):
            return ["Vulkan 1.1"]
        lacks = []
        if not any(flags & DRAWS_AND_COMPUTES == DRAWS_AND_COMPUTES for flags in self.queues):
            lacks.append("a queue family for both graphics and compute")
        missing = [name for bit, name in SUBGROUP_OPERATIONS.items() if not self.subgroup.operations & bit]
        if missing:
            lacks.append(f"subgroup {'/'.join(missing)} operations")
        if not self.subgroup.stages & COMPUTE_STAGE:
            lacks.append("subgroup operations in compute shaders")
        if self.subgroup.size not in SUBGROUP_SIZES:
            lacks.append(f"a subgroup size of 4 to 128 (it has {self.subgroup.size})")
        if min(self.limits.group_invocations, self.limits.group_size[0]) < WORKGROUP:
            lacks.append(f"{WORKGROUP} invocations in a compute workgroup")
        return lacks


def devices(vulkan):
    """Every device, in the loader's order."""
    instance = ctypes.c_void_p()
    application = ApplicationInfo(s_type=0, api=1 << 22 | 1 << 12)
    info = InstanceInfo(s_type=1, application=ctypes.pointer(application))
    if vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)) != 0:
        return []
    count = ctypes.c_uint32()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    handles = (ctypes.c_void_p * max(count.value, 1))()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), handles)
    return [Device(vulkan, handle) for handle in handles[: count.value]]


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
    asked_for = [one for one in found if one.is_asked_for(wanted)]
    if not asked_for:
        return False, f"{wanted} was asked for, and it has only {', '.join(one.name for one in found)}"
    # Among equals the loader's order decides, as in the program.
    one = min(asked_for, key=lambda one: RANKS.get(one.kind, len(RANKS)))
    lacks = one.lacks()
    mesa = re.match(r"Mesa (\d+)\.", one.info)
    if lacks:
        return False, f"{one.name} lacks {', '.join(lacks)}"
    if one.is_lavapipe and (not mesa or int(mesa[1]) < OLDEST_LAVAPIPE):
        return False, f"its lavapipe ({one.info}) is older than Mesa {OLDEST_LAVAPIPE}"
    if not one.is_lavapipe and (one.kind == CPU or one.kind not in RANKS):
        return False, f"{one.name} is neither hardware nor lavapipe"
    if need_layer and not has_validation_layer(vulkan):
        return False, f"{one.name} is good, but Khronos' validation layer, which the tests run under, is missing"
    return True, f"{one.name}, {one.info}" if one.info else one.name


if __name__ == "__main__":
    good, line = verdict(sys.argv[1], "--layer" in sys.argv[2:])
    print(line)
    sys.exit(0 if good else 1)
